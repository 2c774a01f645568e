// The laws a case may name, as a page shows them.
#pragma once

#include <string>

namespace acopla::dem {

class Laws;

/// Two tables in Markdown: every law with the numbers it takes from the case (unit, range, default, meaning), and which laws go together.
std::string laws_table(const Laws& laws);

}  // namespace acopla::dem
