#include "fem/dealii_error.h"

#include <sstream>

namespace acopla::fem {

std::string first_line(const std::exception& error) {
  const std::string text = error.what(), marker = "Additional information:";
  const auto found = text.find(marker);
  std::istringstream lines(found == std::string::npos ? text : text.substr(found + marker.size()));
  std::string line, sentence;
  while (std::getline(lines, line)) {
    const auto from = line.find_first_not_of(" \t-");
    if (from == std::string::npos) {
      if (!sentence.empty()) break;  // a blank line ends the sentence
      continue;
    }
    if (!sentence.empty()) sentence += ' ';
    sentence += line.substr(from);
    if (found == std::string::npos) break;
  }
  return sentence.empty() ? "unknown error" : sentence;
}

}  // namespace acopla::fem
