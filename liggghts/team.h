// The processes of one LIGGGHTS: the first speaks the protocol, the others do what it does.
#pragma once

#include <mpi.h>

#include <string>
#include <type_traits>
#include <vector>

namespace acopla::liggghts {

class Team {
 public:
  /// Whether this process was started by mpirun: then all of them make their Team at once. Alone, MPI begins with the first Team.
  static bool is_launched();

  Team();
  Team(const Team&) = delete;
  Team& operator=(const Team&) = delete;

  int rank() const { return rank_; }
  int size() const { return size_; }
  bool leads() const { return rank_ == 0; }

  /// What the others are to do next; every call of the first process is matched by one of receive() of all others.
  void send(int order);
  /// Waits for it asleep: a structure may compute for minutes between two windows.
  int receive();

  template <class T>
  void share(std::vector<T>& values) {
    static_assert(std::is_trivially_copyable_v<T>);
    unsigned long long size = values.size();
    MPI_Bcast(&size, 1, MPI_UNSIGNED_LONG_LONG, 0, MPI_COMM_WORLD);
    values.resize(size);
    // In pieces, as MPI counts in int.
    constexpr std::size_t piece = 1u << 30;
    auto* bytes = reinterpret_cast<char*>(values.data());
    for (std::size_t done = 0, all = size * sizeof(T); done < all; done += piece)
      MPI_Bcast(bytes + done, static_cast<int>(std::min(piece, all - done)), MPI_BYTE, 0, MPI_COMM_WORLD);
  }
  void share(std::string& text);
  /// Sums over all processes; the sum is the first process's.
  void sum(std::vector<double>& values) const;

  enum class Bond {
    together,  ///< the others wait for an order
    parted,    ///< all have failed by the same error, and end by themselves
    broken     ///< the others are in the middle of a step, and wait for this process
  };
  void set(Bond bond) { bond_ = bond; }
  /// The last call of a process. `order` tells those who wait to end. @return the exit code, unless the bond is broken
  int end(int order, int exit_code);

 private:
  int rank_ = 0, size_ = 1;
  Bond bond_ = Bond::together;
};

}  // namespace acopla::liggghts
