#include "io/results.h"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>

#include "io/error.h"

namespace acopla::io {
namespace fs = std::filesystem;

std::string make_results_folder(const std::string& case_file, const std::string& asked) {
  std::error_code error;
  if (!asked.empty()) {
    if (fs::exists(asked, error))
      throw UserError(fmt::format("{} exists. Results are never overwritten: choose another folder or remove it.", asked));
    if (!fs::create_directories(asked, error))
      throw UserError(fmt::format("{} cannot be made: {}. Choose a folder that can be written.", asked, error.message()));
    return fs::absolute(asked).lexically_normal().string();
  }
  const auto file = fs::absolute(case_file).lexically_normal();
  const auto name = file.filename() == "case.toml" ? file.parent_path().filename().string() : file.stem().string();
  fs::create_directories("results", error);
  for (int number = 1; number < 100000; ++number) {
    const auto folder = fs::path("results") / fmt::format("{}-{:03}", name, number);
    if (fs::create_directory(folder, error)) return fs::absolute(folder).lexically_normal().string();  // no race: made or not
    if (error) break;
  }
  throw UserError(fmt::format("no results folder can be made under {}. Check its permissions, or name one with --results.",
                              fs::absolute("results").string()));
}

void give_up_writing(const std::string& path, const std::string& part) {
  std::error_code error;
  if (fs::is_regular_file(part, error)) fs::remove(part, error);  // and no device
  throw UserError({path, 0, 0}, "the file cannot be written. Check the folder and the free space.");
}

void write_whole(const std::string& path, const std::string& text) {
  const auto part = path + ".part";
  std::ofstream stream(part, std::ios::binary);
  stream << text;
  stream.close();
  std::error_code error;
  if (stream) fs::rename(part, path, error);
  if (!stream || error) give_up_writing(path, part);
}

}  // namespace acopla::io
