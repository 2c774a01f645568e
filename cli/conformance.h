// acopla conformance: examines a participant on the rules of the protocol.
#pragma once

#include <string>
#include <vector>

namespace acopla::cli {

struct ConformanceOptions {
  std::string case_file;              ///< empty: the participant knows of no case
  std::string participant;            ///< its name in the case; empty: the only one, or "participant" without a case
  std::vector<std::string> uses;      ///< without a case: SURFACE:RECEIVES:SENDS, e.g. "top:force:displacement,velocity"
  std::vector<std::string> command;   ///< empty: what the case says
  int dimension = 3;                  ///< without a case
  double window = 0;                  ///< [s]; 0: the case's, or 0.01
  double answer_limit = 60, start_limit = 60, exit_limit = 10;  ///< [s]
  bool quick = false;                 ///< leaves out what takes ten seconds
};

/// Prints a line per rule. @return 0, or 3 when a rule is broken. @throws io::UserError
int conformance(const ConformanceOptions& options);
/// Prints the rules.
int list_rules();

}  // namespace acopla::cli
