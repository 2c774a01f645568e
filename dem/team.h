// Threads that step together.
#pragma once

#include <atomic>
#include <exception>
#include <thread>
#include <vector>

namespace acopla::dem {

/// Runs one function on several numbered tasks, each on a thread of its own choosing, and returns when all are done. Tasks are dealt
/// out by number, so that a task sees the same memory from step to step. With one thread nothing is started and nothing waits.
class Team {
 public:
  explicit Team(unsigned threads);
  ~Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  unsigned threads() const { return static_cast<unsigned>(workers_.size()) + 1; }

  /// @param action  void(unsigned task); an exception of the lowest task is thrown on
  template <class Action>
  void run(unsigned tasks, Action&& action) {
    if (workers_.empty() || tasks < 2) {
      for (unsigned task = 0; task < tasks; ++task) action(task);
      return;
    }
    call_ = [](void* what, unsigned task) { (*static_cast<std::remove_reference_t<Action>*>(what))(task); };
    what_ = &action;
    tasks_ = tasks;
    run_all();
  }

 private:
  void run_all();
  void work(unsigned first);
  void serve(unsigned worker);

  void (*call_)(void*, unsigned) = nullptr;
  void* what_ = nullptr;
  unsigned tasks_ = 0;
  std::atomic<std::uint64_t> round_{0};
  std::atomic<unsigned> busy_{0};
  std::atomic<bool> ends_{false};
  std::vector<std::exception_ptr> errors_;
  std::vector<std::thread> workers_;
};

}  // namespace acopla::dem
