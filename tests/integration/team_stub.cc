// A team without a structure, whose processes fail in every way there is: team_stub WHO WHAT. WHO is a rank, "all", "before" (the first, before any order) or
// "nobody"; WHAT is "throws", "mistakes" (a user's) or "dies".
#include <fmt/format.h>

#include <csignal>
#include <cstdlib>
#include <stdexcept>
#include <string>

#include "fem/distributed/team.h"
#include "io/error.h"

using namespace acopla;

int main(int, char** argv) {
  const std::string who = argv[1], what = argv[2];
  fem::Team team;
  const auto fail = [&] {
    if (what == "dies") std::raise(SIGKILL);
    if (what == "mistakes") throw io::UserError({"case.toml", 3, 1}, "a mistake.");
    throw std::runtime_error(fmt::format("process {} gave up", team.rank()));
  };
  const auto part = [&] {
    team.sum(1);  // all are here
    if (who == "all" || who == std::to_string(team.rank())) fail();
    for (int k = 0; k < 3; ++k) team.sum(1);  // where the others wait
  };
  if (!team.first()) {
    team.follow([&](const fem::Order&) { part(); });
    return 0;
  }
  int code = io::exit_done;
  try {
    if (who == "before") fail();
    team.lead({.task = 7}, part);
    fmt::print("{} processes are well\n", team.size());
  } catch (const io::UserError& error) {
    fmt::print(stderr, "{}\n", error.what());
    code = io::exit_user_error;
  } catch (const std::exception& error) {
    fmt::print(stderr, "the first says: {}\n", error.what());
    code = io::exit_failure;
  }
  return team.end(code);
}
