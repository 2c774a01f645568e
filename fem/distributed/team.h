// The processes that mpirun started: the first leads, the others do what it orders.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

namespace acopla::fem {

/// What all processes are to do next. What the numbers mean is the task's affair.
struct Order {
  std::int64_t task = 0;
  std::int64_t id = 0;
  double a = 0, b = 0, c = 0;
  std::string text = {};
};

/// All processes of one structure. MPI begins and ends with it.
///
/// Work is done together, so that nobody may leave it alone. When a process fails in it, it waits for the others to say the same, which
/// they do at once where all found the same mistake; the first process then reports it as if it were alone. Where they do not, they
/// are waiting for the one that failed, and it ends them all.
class Team {
 public:
  /// How many processes mpirun started, by the environment of Open MPI and MPICH; 1 without mpirun. Does not start MPI.
  static int started();

  /// Starts MPI. Ends this process when mpirun dies.
  Team();
  ~Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  int size() const { return size_; }
  int rank() const { return rank_; }
  bool first() const { return rank_ == 0; }

  /// First process: gives an order, and does its own part of it. @throws what its part threw
  void lead(const Order& order, const std::function<void()>& part);
  /// Others: does their part of every order, until the end is ordered.
  void follow(const std::function<void(const Order&)>& part);
  /// First process, last of all: ends the others and MPI. @return exit_code
  int end(int exit_code);
  bool broken() const { return broken_; }  ///< a process failed alone: no order is heard any more

  // By all processes at once, within an order.
  void send_to_all(std::span<double> values);         ///< of the first process
  void send_to_all(std::span<std::uint32_t> values);  ///< the same
  double largest(double value);
  double sum(double value);
  /// Parts of a whole that lie in it one after another, the first process's first. @param parts  the size of each process's
  void scatter(const double* whole, const std::vector<int>& parts, double* part);
  void gather(const double* part, const std::vector<int>& parts, double* whole);

  struct Communicators;  // communicators.h
  const Communicators& communicators() const { return *communicators_; }

 private:
  void announce(const Order* order, Order& heard);
  bool all_failed();

  std::unique_ptr<Communicators> communicators_;
  int size_ = 1, rank_ = 0;
  bool broken_ = false;
};

}  // namespace acopla::fem
