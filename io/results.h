// Where results go: results/NAME-NNN, the next free number.
#pragma once

#include <string>

namespace acopla::io {

/// Makes the results folder of a run and returns its absolute path. `asked` empty: results/NAME-NNN under the present
/// folder, NAME being the case's folder (or the file's stem where it is not case.toml).
/// @throws UserError when `asked` exists already, or the folder cannot be made
std::string make_results_folder(const std::string& case_file, const std::string& asked);

/// Tells the user that `path` could not be written, and removes what an attempt has left in `part`. @throws UserError always
[[noreturn]] void give_up_writing(const std::string& path, const std::string& part);

/// Writes text to a file whole or not at all (a rename). @throws UserError
void write_whole(const std::string& path, const std::string& text);

}  // namespace acopla::io
