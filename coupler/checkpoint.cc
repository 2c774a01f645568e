#include "coupler/checkpoint.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "coupler/account.h"
#include "coupler/crew.h"
#include "coupler/scheme.h"
#include "io/checkpoint.h"

namespace acopla::coupler {
namespace {

namespace fs = std::filesystem;
constexpr const char* program_version = "acopla-coupler 0.1.0";

}  // namespace

Checkpoints::Checkpoints(const Case& read, const std::string& results, bool resumes) : case_(read), results_(results) {
  if (!resumes) return;
  const auto path = folder() + "/coupler.h5";
  if (!fs::exists(path))
    throw io::UserError({results_, 0, 0}, "there is no checkpoint to resume from. A run writes them where its case has coupling.checkpoint_every = SECONDS.");
  auto [state, info] = io::read_checkpoint(path);
  if (info.program_version != program_version)
    throw io::UserError({path, 0, 0}, fmt::format("was written by {}, this is {}. Resume with the version that wrote it.", info.program_version, program_version));
  if (info.case_hash != io::hash_of(case_.text))
    throw io::UserError({case_.file, 0, 0}, fmt::format("is not the case that {} was run with. Of a run that is resumed only end, title, coupling.output_every "
                                                        "and coupling.checkpoint_every may change: undo the other changes, or start a new run.", results_));
  state_ = std::move(state);
  windows_ = info.ticks;
  time_ = info.time;
  io::StateReader reader(state_);
  reader("rows", rows_);
  if (case_.window > 0) check();  // before anybody is waited for
}

void Checkpoints::check() const {
  if (windows_ >= case_.windows)
    throw io::UserError({case_.file, 0, 0}, fmt::format("ends at {:.6g} s, and the checkpoint in {} is of {:.6g} s: nothing is left to compute. Raise end to go on.",
                                                        case_.end, results_, time_));
  if (std::abs(case_.time(windows_) - time_) > 1e-9 * time_)
    throw io::UserError(case_.in_steps.at, fmt::format("gives windows of {:.10g} s, those of the run in {} are of {:.10g} s. Give that many seconds, and an end that is a whole "
                                                       "number of them.", case_.window, results_, time_ / static_cast<double>(windows_)));
}

void Checkpoints::resume(Crew& crew, Account& account, Scheme& scheme) {
  crew.resume(folder());
  io::StateReader reader(state_);
  reader("rows", rows_);
  reader("crew", crew);
  reader("account", account);
  scheme.read(reader);
  reader.finish();
  state_ = {};
}

void Checkpoints::write(Crew& crew, Account& account, Scheme& scheme) {
  const auto next = folder() + ".next";
  fs::remove_all(next);
  fs::create_directories(next);
  account.flush();
  crew.checkpoint(next);
  io::State state;
  io::StateWriter writer(state);
  auto rows = account.rows();
  writer("rows", rows);
  writer("crew", crew);
  writer("account", account);
  scheme.write(writer);
  const auto windows = account.complete();
  io::write_checkpoint(next + "/coupler.h5", state, {program_version, "coupler", case_.time(windows), windows, io::hash_of(case_.text)});
  if (renameat2(AT_FDCWD, next.c_str(), AT_FDCWD, folder().c_str(), RENAME_EXCHANGE) != 0 &&
      rename(next.c_str(), folder().c_str()) != 0)  // the first
    throw io::UserError({folder(), 0, 0}, fmt::format("the checkpoint cannot take its name: {}.", std::strerror(errno)));
  fs::remove_all(next);
}

}  // namespace acopla::coupler
