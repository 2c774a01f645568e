#include "coupler/coupler.h"

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <optional>

#include "coupler/account.h"
#include "coupler/checkpoint.h"
#include "coupler/crew.h"
#include "coupler/failure.h"
#include "coupler/one_way.h"
#include "coupler/quantities.h"
#include "coupler/record.h"
#include "coupler/two_way.h"
#include "io/results.h"

namespace acopla::coupler {
namespace {

// The stages of a run, kept so that a failure in any of them still finds what the others came to.
struct Stages {
  explicit Stages(const Case& read) : quantities(read.expectations) {}
  Quantities quantities;
  std::optional<Record> record;
  std::optional<Account> account;
  std::unique_ptr<Scheme> scheme;
};

std::unique_ptr<Scheme> scheme_of(const Case& read, Crew& crew, Account& account, Reporter& reporter) {
  if (read.scheme == SchemeKind::one_way) return std::make_unique<OneWay>(read, crew, account);
  return std::make_unique<TwoWay>(read, crew, account, reporter);
}

void compute(Case& read, Crew& crew, const Coupler::Options& options, Checkpoints& checkpoints, Reporter& reporter,
             Stages& stages, std::chrono::steady_clock::time_point begin) {
  crew.assemble();
  if (options.resumes) checkpoints.check();
  stages.record.emplace(read, options.results, checkpoints.rows(), checkpoints.windows());
  auto& account = stages.account.emplace(read, crew, *stages.record, stages.quantities, reporter);
  stages.scheme = scheme_of(read, crew, account, reporter);
  if (options.resumes) checkpoints.resume(crew, account, *stages.scheme);
  reporter.assembled(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  account.begin();
  while (account.complete() < read.windows) {
    stages.scheme->step();
    if (checkpoints.due(account.complete()) && !options.results.empty()) checkpoints.write(crew, account, *stages.scheme);
  }
  for (const auto& [name, value] : crew.finish()) stages.quantities.add(name, read.end, value);
}

void note_error(Outcome& outcome, Status status, int exit_code, Outcome::Error error) {
  outcome.status = status;
  outcome.exit_code = exit_code;
  outcome.error = std::move(error);
}

int exit_code_of(Failure::Cause cause) {
  return cause == Failure::Cause::limit     ? io::exit_missed
         : cause == Failure::Cause::mistake ? io::exit_user_error
                                            : io::exit_failure;
}

// Runs the stages and turns whatever ends them early into words.
void attempt(Case& read, Crew& crew, const Coupler::Options& options, Checkpoints& checkpoints, Reporter& reporter,
             Stages& stages, std::chrono::steady_clock::time_point begin, Outcome& outcome) {
  try {
    compute(read, crew, options, checkpoints, reporter, stages, begin);
    outcome.status = Status::met;
    outcome.exit_code = io::exit_done;
  } catch (const Interrupted& interrupted) {
    note_error(outcome, Status::interrupted, io::exit_interrupted,
               {"coupler", "running", interrupted.what()});
  } catch (const Failure& failure) {
    note_error(outcome, Status::failed, exit_code_of(failure.cause()),
               {failure.participant(), failure.state(), failure.what()});
  } catch (const io::UserError& error) {
    note_error(outcome, Status::failed, io::exit_user_error, {"coupler", "starting", error.what()});
  } catch (const std::exception& error) {
    note_error(outcome, Status::failed, io::exit_failure,
               {"coupler", "running", fmt::format("the coupler failed: {}", error.what())});
  }
  if (outcome.error) crew.dismiss(outcome.error->message);
}

void gather(const Case& read, const Crew& crew, const Stages& stages, Outcome& outcome) {
  outcome.title = read.title;
  outcome.end = read.end;
  outcome.participants = crew.outcomes();
  outcome.quantities = stages.quantities.last();
  if (stages.account) {
    const auto cut = stages.record->cut_short();
    const auto complete = cut ? cut->complete : stages.account->complete();
    outcome.windows = cut ? cut->rows : stages.account->rows();
    outcome.reached = complete == read.windows ? read.end : read.time(complete);
    outcome.seconds_windows = stages.account->seconds();
    outcome.ledgers = stages.account->ledgers();
    outcome.interfaces = stages.account->interfaces();
  }
  for (const auto& expectation : read.expectations)
    outcome.expectations.push_back(stages.quantities.check(expectation));
  if (outcome.status != Status::met) return;
  for (const auto& checked : outcome.expectations)
    if (!checked.met) {
      outcome.status = Status::missed;
      outcome.exit_code = io::exit_missed;
    }
}

// A full disk ends a run and has no room for the summary either: what went wrong first is what is told.
void write_summary(const std::string& results, Outcome& outcome) {
  try {
    io::write_whole(results + "/summary.json", summary_text(outcome));
  } catch (const io::UserError& error) {
    if (!outcome.error) note_error(outcome, Status::failed, io::exit_user_error, {"coupler", "writing the summary", error.what()});
  }
}

}  // namespace

Outcome Coupler::run() {
  const auto begin = std::chrono::steady_clock::now();
  Checkpoints checkpoints(case_, options_.results, options_.resumes);
  Crew crew(context_, options_.endpoint, case_, options_.results, reporter_, options_.outside, options_.resumes, options_.keys);
  Outcome outcome;
  {
    Stages stages(case_);
    attempt(case_, crew, options_, checkpoints, reporter_, stages, begin, outcome);
    gather(case_, crew, stages, outcome);
  }  // the series are closed before the summary says that they are there
  outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  if (!options_.results.empty()) write_summary(options_.results, outcome);
  reporter_.done(outcome);
  return outcome;
}

}  // namespace acopla::coupler
