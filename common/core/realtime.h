#pragma once

/// Marks a function that must not allocate, lock, throw or block, after its `noexcept`. Clang 20
/// and later check it: at run time under -fsanitize=realtime, and at compile time with
/// -Wfunction-effects. Elsewhere it is a comment.
#if defined(__clang__) && defined(__has_cpp_attribute)
#if __has_cpp_attribute(clang::nonblocking)
#define TUMBLER_NONBLOCKING [[clang::nonblocking]]
#endif
#endif
#ifndef TUMBLER_NONBLOCKING
#define TUMBLER_NONBLOCKING
#endif
