#include "io/results.h"
#include "tests/unit/io/scratch.h"

namespace acopla::io {
namespace {

class Results : public Scratch {
 protected:
  void SetUp() override {
    Scratch::SetUp();
    before_ = std::filesystem::current_path();
    std::filesystem::current_path(folder_);
  }
  void TearDown() override {
    std::filesystem::current_path(before_);
    Scratch::TearDown();
  }
  std::filesystem::path before_;
};

TEST_F(Results, TheNextFreeNumberIsTaken) {
  EXPECT_EQ(make_results_folder("cases/box_fill/case.toml", ""), path("results/box_fill-001"));
  EXPECT_EQ(make_results_folder("cases/box_fill/case.toml", ""), path("results/box_fill-002"));
  EXPECT_EQ(make_results_folder("pipe.toml", ""), path("results/pipe-001"));
  EXPECT_TRUE(std::filesystem::is_directory(path("results/box_fill-002")));
}

TEST_F(Results, AnExplicitFolderIsMadeWhole) {
  EXPECT_EQ(make_results_folder("case.toml", "a/b"), path("a/b"));
  EXPECT_EQ(make_results_folder("case.toml", "c/d/").substr(0, path("c/d").size()), path("c/d"));
  EXPECT_TRUE(std::filesystem::is_directory(path("c/d")));
}

TEST_F(Results, AnExplicitFolderThatExistsIsRefused) {
  std::filesystem::create_directory("there");
  expect_mistake([] { make_results_folder("case.toml", "there"); },
                 "there exists. Results are never overwritten");
  write("file", "x");
  expect_mistake([] { make_results_folder("case.toml", "file/inside"); }, "file/inside");
}

TEST_F(Results, WritingWholeReplacesAndLeavesNoPart) {
  write_whole("x.json", "one");
  write_whole("x.json", "two");
  EXPECT_EQ(read("x.json"), "two");
  EXPECT_FALSE(std::filesystem::exists("x.json.part"));
  expect_mistake([] { write_whole("no/such/folder/x", "one"); }, "the file cannot be written");
}

}  // namespace
}  // namespace acopla::io
