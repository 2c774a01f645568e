#include "fem/distributed/team.h"

#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <thread>

#include "fem/distributed/communicators.h"
#include "io/error.h"

namespace acopla::fem {
namespace {

using namespace std::chrono_literals;

constexpr std::int64_t end_task = -1;
/// How long a process that failed waits for the others to say the same. A death is to be reported within 2 s.
constexpr auto agreement_limit = 750ms;

/// Waits for a request. Open MPI's own wait keeps a core busy, and a structure spends most of a coupled run waiting for particles: this
/// one looks for 1 ms, which covers the orders within a window, and then sleeps between looks, up to 1 ms, which is lost once a window.
/// mpi_yield_when_idle would not do: it gives way, but still shows as a busy core. @return false when the limit passed
bool wait_idle(MPI_Request& request, std::chrono::milliseconds limit = std::chrono::milliseconds::max()) {
  const auto start = std::chrono::steady_clock::now();
  auto nap = 20us;
  for (int done = 0;;) {
    MPI_Test(&request, &done, MPI_STATUS_IGNORE);
    if (done) return true;
    const auto waited = std::chrono::steady_clock::now() - start;
    if (limit != std::chrono::milliseconds::max() && waited > limit) return false;
    if (waited < 1ms) {
      sched_yield();
      continue;
    }
    std::this_thread::sleep_for(nap);
    nap = std::min(nap * 2, std::chrono::microseconds(1000));
  }
}

struct Header {
  std::int64_t task, id;
  double a, b, c;
  std::uint64_t text;
};

}  // namespace

int Team::started() {
  for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"})
    if (const char* size = std::getenv(name)) return std::max(1, std::atoi(size));
  return 1;
}

Team::Team() : communicators_(std::make_unique<Communicators>()) {
  // mpirun gives its processes groups of their own, which the death of mpirun by SIGKILL would leave behind.
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  int given = 0;
  MPI_Init_thread(nullptr, nullptr, MPI_THREAD_FUNNELED, &given);
  MPI_Comm_size(MPI_COMM_WORLD, &size_);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  for (auto* communicator : {&communicators_->orders, &communicators_->work, &communicators_->failures})
    MPI_Comm_dup(MPI_COMM_WORLD, communicator);
}

Team::~Team() {
  int ended = 0;
  MPI_Finalized(&ended);
  if (!ended) MPI_Finalize();
}

/// @param order  of the first process, null for the others
void Team::announce(const Order* order, Order& heard) {
  const auto share = [&](void* bytes, std::size_t count) {
    MPI_Request request;
    MPI_Ibcast(bytes, static_cast<int>(count), MPI_BYTE, 0, communicators_->orders, &request);
    wait_idle(request);
  };
  Header header{};
  if (order) header = {order->task, order->id, order->a, order->b, order->c, order->text.size()};
  share(&header, sizeof header);
  std::string text = order ? order->text : std::string(header.text, '\0');
  if (header.text > 0) share(text.data(), text.size());
  heard = {header.task, header.id, header.a, header.b, header.c, std::move(text)};
}

bool Team::all_failed() {
  MPI_Request request;
  MPI_Ibarrier(communicators_->failures, &request);
  return wait_idle(request, agreement_limit);
}

void Team::lead(const Order& order, const std::function<void()>& part) {
  if (broken_) throw std::runtime_error("the processes of the structure do not answer any more");
  Order heard;
  announce(&order, heard);
  try {
    part();
  } catch (...) {
    if (!all_failed()) broken_ = true;
    throw;
  }
}

void Team::follow(const std::function<void(const Order&)>& part) {
  const auto fail = [&](const std::string& sentence, int code) {
    if (all_failed()) return;
    std::fprintf(stderr, "%s\n", sentence.c_str());
    std::fflush(stderr);
    MPI_Abort(MPI_COMM_WORLD, code);
  };
  for (;;) {
    Order order;
    announce(nullptr, order);
    if (order.task == end_task) break;
    try {
      part(order);
    } catch (const io::UserError& error) {
      fail(error.what(), io::exit_user_error);
    } catch (const std::exception& error) {
      fail("acopla-fem, process " + std::to_string(rank_ + 1) + " of " + std::to_string(size_) + ": " + error.what(), io::exit_failure);
    }
  }
}

int Team::end(int exit_code) {
  std::fflush(nullptr);
  if (broken_) MPI_Abort(MPI_COMM_WORLD, exit_code == 0 ? io::exit_failure : exit_code);
  Order heard;
  const Order last{.task = end_task};
  announce(&last, heard);
  return exit_code;
}

void Team::send_to_all(std::span<double> values) {
  MPI_Bcast(values.data(), static_cast<int>(values.size()), MPI_DOUBLE, 0, communicators_->work);
}

void Team::send_to_all(std::span<std::uint32_t> values) {
  MPI_Bcast(values.data(), static_cast<int>(values.size()), MPI_UINT32_T, 0, communicators_->work);
}

double Team::largest(double value) {
  MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_DOUBLE, MPI_MAX, communicators_->work);
  return value;
}

double Team::sum(double value) {
  MPI_Allreduce(MPI_IN_PLACE, &value, 1, MPI_DOUBLE, MPI_SUM, communicators_->work);
  return value;
}

namespace {
std::vector<int> starts_of(const std::vector<int>& parts) {
  std::vector<int> starts(parts.size(), 0);
  for (std::size_t r = 1; r < parts.size(); ++r) starts[r] = starts[r - 1] + parts[r - 1];
  return starts;
}
}  // namespace

void Team::scatter(const double* whole, const std::vector<int>& parts, double* part) {
  const auto starts = starts_of(parts);
  MPI_Scatterv(whole, parts.data(), starts.data(), MPI_DOUBLE, part, parts[static_cast<std::size_t>(rank_)], MPI_DOUBLE, 0, communicators_->work);
}

void Team::gather(const double* part, const std::vector<int>& parts, double* whole) {
  const auto starts = starts_of(parts);
  MPI_Gatherv(part, parts[static_cast<std::size_t>(rank_)], MPI_DOUBLE, whole, parts.data(), starts.data(), MPI_DOUBLE, 0, communicators_->work);
}

}  // namespace acopla::fem
