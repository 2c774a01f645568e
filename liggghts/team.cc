#include "liggghts/team.h"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <thread>

namespace acopla::liggghts {

bool Team::is_launched() {
  return std::getenv("OMPI_COMM_WORLD_SIZE") || std::getenv("PMI_SIZE") || std::getenv("PMIX_RANK");
}

Team::Team() {
  int provided = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &provided);  // the pulse has a thread, which knows nothing of MPI
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
}

void Team::send(int order) {
  MPI_Request request;
  MPI_Ibcast(&order, 1, MPI_INT, 0, MPI_COMM_WORLD, &request);
  MPI_Wait(&request, MPI_STATUS_IGNORE);
}

int Team::receive() {
  int order = 0, arrived = 0;
  MPI_Request request;
  MPI_Ibcast(&order, 1, MPI_INT, 0, MPI_COMM_WORLD, &request);
  // MPI's own waits spin. This one is late by a tenth of what it has waited, and by a millisecond at most.
  const auto begin = std::chrono::steady_clock::now();
  for (MPI_Test(&request, &arrived, MPI_STATUS_IGNORE); !arrived; MPI_Test(&request, &arrived, MPI_STATUS_IGNORE)) {
    const auto waited = std::chrono::steady_clock::now() - begin;
    std::this_thread::sleep_for(std::clamp<std::chrono::nanoseconds>(waited / 10, std::chrono::microseconds(1), std::chrono::milliseconds(1)));
  }
  return order;
}

void Team::share(std::string& text) {
  std::vector<char> letters(text.begin(), text.end());
  share(letters);
  text.assign(letters.begin(), letters.end());
}

void Team::sum(std::vector<double>& values) const {
  if (size_ == 1) return;
  constexpr std::size_t piece = 1u << 27;
  for (std::size_t done = 0; done < values.size(); done += piece) {
    auto* some = values.data() + done;
    const int count = static_cast<int>(std::min(piece, values.size() - done));
    MPI_Reduce(leads() ? MPI_IN_PLACE : some, some, count, MPI_DOUBLE, MPI_SUM, 0, MPI_COMM_WORLD);
  }
}

int Team::end(int order, int exit_code) {
  if (bond_ == Bond::broken) MPI_Abort(MPI_COMM_WORLD, exit_code);
  if (bond_ == Bond::together && leads()) send(order);
  MPI_Finalize();
  return exit_code;
}

}  // namespace acopla::liggghts
