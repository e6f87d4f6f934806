#include "offline/studies/processes.h"

#include <fmt/format.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <numeric>
#include <stdexcept>

#ifdef TUMBLER_WITH_MPI
#include <mpi.h>
#endif

namespace tumbler {
namespace {

/// The variables with which mpirun of Open MPI, MPICH and Slurm's srun tell a process its place.
bool StartedTogether() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "PMIX_RANK"}) {
    if (std::getenv(name) != nullptr) return true;  // NOLINT(concurrency-mt-unsafe)
  }
  return false;
}

}  // namespace

#ifdef TUMBLER_WITH_MPI

bool Processes::Supported() { return true; }

Processes::Processes() : together_(StartedTogether()) {
  if (!together_) return;
  MPI_Init(nullptr, nullptr);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
}

Processes::~Processes() {
  if (together_) MPI_Finalize();
}

std::string Processes::FromFirst(std::string text) const {
  if (count_ == 1) return text;
  auto size = static_cast<unsigned long long>(text.size());
  MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, 0, MPI_COMM_WORLD);
  text.resize(size);
  MPI_Bcast(text.data(), static_cast<int>(size), MPI_CHAR, 0, MPI_COMM_WORLD);
  return text;
}

std::vector<std::string> Processes::ToFirst(const std::string& text) const {
  if (count_ == 1) return {text};
  const int size = static_cast<int>(text.size());
  std::vector<int> sizes(static_cast<std::size_t>(count_)), places(sizes.size());
  MPI_Gather(&size, 1, MPI_INT, sizes.data(), 1, MPI_INT, 0, MPI_COMM_WORLD);
  std::exclusive_scan(sizes.begin(), sizes.end(), places.begin(), 0);
  std::string all(rank_ == 0 ? static_cast<std::size_t>(places.back() + sizes.back()) : 0, '\0');
  MPI_Gatherv(text.data(), size, MPI_CHAR, all.data(), sizes.data(), places.data(), MPI_CHAR, 0,
              MPI_COMM_WORLD);
  std::vector<std::string> texts;
  for (std::size_t i = 0; rank_ == 0 && i < sizes.size(); ++i) {
    texts.push_back(
        all.substr(static_cast<std::size_t>(places[i]), static_cast<std::size_t>(sizes[i])));
  }
  return texts;
}

void Processes::Abort(int status) const {
  if (count_ > 1) MPI_Abort(MPI_COMM_WORLD, status);
}

#else

bool Processes::Supported() { return false; }

Processes::Processes() : together_(StartedTogether()) {
  if (together_) {
    throw std::runtime_error(
        "this build has no MPI, so that each process would do the whole work: install "
        "libopenmpi-dev and configure again, or start the program without mpirun");
  }
}

Processes::~Processes() = default;

std::string Processes::FromFirst(std::string text) const { return text; }

std::vector<std::string> Processes::ToFirst(const std::string& text) const { return {text}; }

void Processes::Abort(int /*status*/) const {}

#endif

ExitStatus RunTogether(const std::string& speaker,
                       const std::function<ExitStatus(const Processes& processes)>& work) {
  const Processes processes;
  try {
    return work(processes);
  } catch (const std::exception& error) {
    if (processes.count() > 1) {
      fmt::print(stderr, "{}: {}\n", speaker, error.what());
      processes.Abort(static_cast<int>(ExitStatus::kUnusable));
    }
    throw;
  }
}

}  // namespace tumbler
