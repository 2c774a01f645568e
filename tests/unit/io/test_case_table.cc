// The case reader: values, and mistakes that say what, where and how to mend it.
#include "io/case_table.h"
#include "tests/unit/io/scratch.h"

namespace acopla::io {
namespace {

Table parse(const std::string& text) { return Table::from_text(text, "case.toml"); }

TEST(CaseTable, ReadsEveryTypeOfValue) {
  const auto root = parse(R"(
n = 3
x = 1.5
yes = true
name = "glass"
list = [1, 2.5]
words = ["a", "b"]
point = [1, 2, 3]
box = [[0, 0, 0], [1, 1, 1.6]]
pairs = [["glass", "steel"]]
[inner]
y = 2
[[many]]
z = 1
[[many]]
z = 2
)");
  EXPECT_EQ(root.integer("n", 0, 10), 3);
  EXPECT_EQ(root.number("n"), 3);
  EXPECT_EQ(root.number("x", positive), 1.5);
  EXPECT_TRUE(root.flag("yes", false));
  EXPECT_EQ(root.text("name"), "glass");
  EXPECT_EQ(root.choice("name", {"glass", "steel"}), "glass");
  EXPECT_EQ(root.numbers("list"), (std::vector<double>{1, 2.5}));
  EXPECT_EQ(root.texts("words"), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(root.vector("point", 3), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(root.vectors("box", 3)[1], Eigen::Vector3d(1, 1, 1.6));
  EXPECT_EQ(root.text_pairs("pairs")[0].second, "steel");
  EXPECT_EQ(root.table("inner").number("y"), 2);
  ASSERT_EQ(root.list("many").size(), 2u);
  EXPECT_EQ(root.list("many")[0].integer("z", 0, 9), 1);
  EXPECT_EQ(root.list("many")[1].integer("z", 0, 9), 2);
  EXPECT_EQ(root.number("absent", any, 7), 7);
  EXPECT_FALSE(root.optional_number("absent").has_value());
  EXPECT_FALSE(root.table_or_empty("absent").has("x"));
  EXPECT_NO_THROW(root.reject_unknown());
}

TEST(CaseTable, KeysComeInTheOrderOfTheFile) {
  EXPECT_EQ(parse("b = 1\na = 2\n[z]\n[c]\n").keys(),
            (std::vector<std::string>{"b", "a", "z", "c"}));
}

TEST(CaseTable, ANumberOutOfRangeSaysTheRangeAndWhy) {
  const Range poisson{-1, 0.5, true, true,
                      "Poisson's ratio of a stable isotropic solid is below 0.5."};
  expect_mistake(
      [&] { parse("[glass]\n  poisson = 0.6\n").table("glass").number("poisson", poisson); },
      "case.toml:2:3: glass.poisson = 0.6 is outside (-1, 0.5). Poisson's ratio of a stable "
      "isotropic solid is below 0.5.");
  EXPECT_EQ(positive.text(), "(0, inf)");
  EXPECT_EQ(any.text(), "(-inf, inf)");
  EXPECT_FALSE(positive.contains(0));
  EXPECT_TRUE(non_negative.contains(0));
  EXPECT_FALSE(fraction.contains(1.1));
}

TEST(CaseTable, NumbersThatAreNoneAreRefused) {
  for (const char* value : {"nan", "inf", "-inf"})
    expect_mistake([&] { parse(std::string("x = ") + value).number("x"); }, "case.toml:1:1: x = ");
  expect_mistake([] { parse("x = nan").number("x"); }, "is not a finite number");
  expect_mistake([] { parse("x = \"3\"").number("x"); },
                 "case.toml:1:1: x must be a number, not text.");
  expect_mistake([] { parse("x = true").number("x"); }, "must be a number, not true or false.");
  expect_mistake([] { parse("x = 1.5").integer("x", 0, 9); }, "must be an integer, not a number.");
  expect_mistake([] { parse("x = 15").integer("x", 0, 9); }, "x = 15 is outside [0, 9].");
  expect_mistake([] { parse("x = [1, nan]").numbers("x"); }, "is not a finite number");
  expect_mistake([] { parse("x = 99999999999999999999").integer("x", 0, 9); }, "not valid TOML");
  // Headings of which toml++ assumes that nobody writes them.
  for (const char* heading : {"[.a]", "[[.a]]", "[ =]", "[#]"}) expect_mistake([&] { parse(std::string("x = 1\n") + heading); }, "case.toml:2");
}

TEST(CaseTable, OtherWrongTypes) {
  const auto root = parse("t = 3\nl = [1, \"a\"]\nv = [1, 2]\n[table]\n");
  expect_mistake([&] { root.text("t"); }, "t must be text in quotes, not an integer.");
  expect_mistake([&] { root.flag("t", true); }, "t must be true or false, not an integer.");
  expect_mistake([&] { root.texts("l"); },
                 "case.toml:2:1: l must be a list of texts, but holds an integer.");
  expect_mistake([&] { root.vector("v", 3); }, "v must have 3 components, not 2.");
  EXPECT_EQ(root.vector("v", 2), Eigen::Vector3d(1, 2, 0));
  expect_mistake([&] { root.table("t"); }, "t must be a table, not an integer.");
  expect_mistake([&] { root.list("t"); },
                 "t must be a list of tables, written [[t]], not an integer.");
  expect_mistake([&] { root.number("table"); }, "table must be a number, not a table.");
  expect_mistake([&] { root.text_pairs("l"); }, "must be a list of pairs of names");
}

TEST(CaseTable, AMissingKeyIsLocatedAtItsTable) {
  expect_mistake([] { parse("a = 1\n\n[inner]\n").table("inner").number("density"); },
                 "case.toml:3:1: inner.density is missing. Add it to this table.");
}

TEST(CaseTable, AMissingKeyThatStandsThereMisspeltIsFound) {
  expect_mistake([] { parse("[inner]\ndensty = 3\n").table("inner").number("density"); },
                 "case.toml:2:1: inner.densty stands where density is missing. Is it misspelt?");
}

TEST(CaseTable, AnUnknownKeyNamesTheNearestThatWasAskedFor) {
  const auto root = parse("title = \"x\"\n[inner]\nfricton = 0.5\n");
  root.text("title");
  root.table("inner").number("friction", any, 0.0);
  expect_mistake([&] { root.reject_unknown(); },
                 "case.toml:3:1: inner.fricton is not a known key. Did you mean friction?");
}

TEST(CaseTable, AnUnknownKeyInAListIsFoundAndSkippedOnesAreNot) {
  const auto root = parse("[[many]]\nx = 1\n[[many]]\ny = 2\n[other]\nanything = 1\n");
  for (const auto& entry : root.list("many")) entry.number("x", any, 0);
  root.skip("other");
  expect_mistake([&] { root.reject_unknown(); }, "case.toml:4:1: many[1].y is not a known key.");
}

TEST(CaseTable, AChoiceNamesAllAndTheNearest) {
  expect_mistake(
      [] {
        parse("law = \"herz\"").choice("law", {"hertz", "linear"});
      },
      "law = \"herz\" is not one of \"hertz\", \"linear\". Did you mean \"hertz\"?");
}

TEST(CaseTable, NearestWords) {
  EXPECT_EQ(nearest_word("fricton", {"density", "friction"}).value_or(""), "friction");
  EXPECT_EQ(nearest_word("rte", {"name", "rate"}).value_or(""), "rate");
  EXPECT_EQ(nearest_word("form", {"from", "until"}).value_or(""), "from");
  EXPECT_FALSE(nearest_word("rate", {"name", "region"}).has_value());
  EXPECT_FALSE(nearest_word("zzz", {"density", "friction"}).has_value());
  EXPECT_FALSE(nearest_word("x", {}).has_value());
}

TEST(CaseTable, BrokenTomlIsLocated) {
  expect_mistake([] { parse("a = 1\nb = = 2\n"); }, "case.toml:2:");
}

using CaseFile = Scratch;

TEST_F(CaseFile, FilesThatCannotBeRead) {
  expect_mistake([&] { Table::from_file(path("none.toml")); }, "the case file cannot be read");
  expect_mistake([&] { Table::from_file(folder_.string()); },
                 "is a folder. Name the case file in it");
}

TEST_F(CaseFile, PathsAreRelativeToTheCase) {
  write("box.stl", "solid");
  const auto root =
      Table::from_file(write("case.toml", "mesh = \"box.stl\"\nother = \"bx.stl\"\n"));
  EXPECT_EQ(root.path("mesh"), path("box.stl"));
  EXPECT_EQ(root.path("other", false), path("bx.stl"));
  expect_mistake(
      [&] { root.path("other"); },
      "case.toml:2:1: other = \"bx.stl\" does not exist. Paths are relative to the case file;");
}

}  // namespace
}  // namespace acopla::io
