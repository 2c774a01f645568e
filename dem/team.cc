#include "dem/team.h"

namespace acopla::dem {
namespace {

// A step lasts some hundred microseconds: whoever waits looks again for about that long before it sleeps.
template <class Value>
void wait_while(const std::atomic<Value>& value, Value old) {
  for (int look = 0; look < 4000; ++look) {
    if (value.load(std::memory_order_acquire) != old) return;
#if defined(__x86_64__)
    __builtin_ia32_pause();
#endif
  }
  value.wait(old, std::memory_order_acquire);
}

}  // namespace

Team::Team(unsigned threads) {
  for (unsigned worker = 1; worker < threads; ++worker) workers_.emplace_back([this, worker] { serve(worker); });
}

Team::~Team() {
  ends_ = true;
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  for (auto& worker : workers_) worker.join();
}

void Team::run_all() {
  errors_.assign(tasks_, nullptr);
  busy_.store(static_cast<unsigned>(workers_.size()), std::memory_order_relaxed);
  round_.fetch_add(1, std::memory_order_release);
  round_.notify_all();
  work(0);
  for (unsigned busy = busy_.load(std::memory_order_acquire); busy != 0; busy = busy_.load(std::memory_order_acquire)) wait_while(busy_, busy);
  for (auto& error : errors_)
    if (error) std::rethrow_exception(error);
}

void Team::work(unsigned first) {
  for (unsigned task = first; task < tasks_; task += threads()) try {
      call_(what_, task);
    } catch (...) {
      errors_[task] = std::current_exception();
    }
}

void Team::serve(unsigned worker) {
  std::uint64_t seen = 0;
  while (true) {
    wait_while(round_, seen);
    seen = round_.load(std::memory_order_acquire);
    if (ends_) return;
    work(worker);
    if (busy_.fetch_sub(1, std::memory_order_acq_rel) == 1) busy_.notify_all();
  }
}

}  // namespace acopla::dem
