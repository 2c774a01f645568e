// The library calls its error functions through the dynamic linker, which takes those of the program before the library's own. Its own print
// to a screen and call exit or MPI_Abort; these carry the words to whoever asked.
#include "liggghts/failure.h"

#include <compute.h>
#include <error.h>
#include <fix.h>
#include <fmt/format.h>
#include <mpi.h>

#include <cstdio>
#include <cstring>

namespace {

[[noreturn]] void fail_all(const std::string& words) { throw acopla::liggghts::Failure("LIGGGHTS: " + words, true); }

// One process alone: the others are in the middle of something, and only the first can tell the coupler.
[[noreturn]] void fail_one(const std::string& words) {
  int rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  if (rank == 0) throw acopla::liggghts::Failure("LIGGGHTS: " + words, false);
  fmt::print(stderr, "acopla-liggghts: process {}: LIGGGHTS: {}\n", rank, words);
  std::fflush(stderr);
  MPI_Abort(MPI_COMM_WORLD, 1);
  throw acopla::liggghts::Failure(words, false);
}

std::string about(const char* kind, const char* style, const char* id, const char* words) {
  if (std::strlen(words) > 2) return fmt::format("{} {} (id {}): {}", kind, style, id, words);
  return fmt::format("illegal {} {} (id {})", kind, style, id);
}

}  // namespace

namespace LAMMPS_NS {

void Error::all(const char*, int, const char* words) { fail_all(words); }
void Error::universe_all(const char*, int, const char* words) { fail_all(words); }
void Error::fix_error(const char*, int, Fix* fix, const char* words) { fail_all(about("fix", fix->style, fix->id, words)); }
void Error::fix_error(const char*, int, Fix* fix, const char* style, const char* words) { fail_all(about("fix", style, fix->id, words)); }
void Error::compute_error(const char*, int, Compute* compute, const char* words) { fail_all(about("compute", compute->style, compute->id, words)); }
void Error::one(const char*, int, const char* words) { fail_one(words); }
void Error::universe_one(const char*, int, const char* words) { fail_one(words); }
void Error::warning(const char*, int, const char* words, int) { fmt::print(stderr, "LIGGGHTS warns: {}\n", words); }

}  // namespace LAMMPS_NS
