#pragma once

#include <functional>

namespace tumbler {

/// Runs work(index, thread) for indices 0 ... count - 1 on several threads, the caller's among
/// them; each index exactly once. Threads are numbered from 0.
/// @throws what `work` throws, once all threads have ended; other indices may be left out then.
void ParallelFor(int count, int threads, const std::function<void(int, int)>& work);

}  // namespace tumbler
