// Kernels of every built-in combination of laws, and the table of laws.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "dem/laws_table.h"
#include "tests/unit/dem/kernel_properties.h"

namespace acopla::dem::test {
namespace {

class Kernels : public ::testing::TestWithParam<std::tuple<LawSet, int>> {
 public:
  void SetUp() override {
    auto pair = soft_glass();
    pair.laws = std::get<LawSet>(GetParam());
    kernel_ = Laws::built_in().make(pair, dimension());
  }
  const Kernel& kernel() const { return *kernel_; }
  static int dimension() { return std::get<int>(GetParam()); }

 private:
  std::unique_ptr<Kernel> kernel_;
};

TEST_P(Kernels, ActAndReact) { expect_action_and_reaction(kernel(), dimension()); }
TEST_P(Kernels, DoNotAskWhichBodyIsFirst) { expect_names_do_not_matter(kernel(), dimension()); }
TEST_P(Kernels, KeepLanesApart) { expect_lanes_do_not_meet(kernel(), dimension()); }
TEST_P(Kernels, AreSilentWithoutContact) { expect_silence_without_contact(kernel(), dimension()); }
TEST_P(Kernels, ExportTheForcesOnOthers) { expect_exports_are_the_forces_on_j(kernel(), dimension()); }
TEST_P(Kernels, TreatWallsLikeBodies) { expect_walls_to_be_bodies(kernel(), dimension()); }
TEST_P(Kernels, AreNotChangedByTheLedger) { expect_the_ledger_not_to_act(kernel(), dimension()); }

INSTANTIATE_TEST_SUITE_P(BuiltIn, Kernels, ::testing::Combine(::testing::ValuesIn(Laws::built_in().combinations()), ::testing::Values(2, 3)),
                         [](const auto& instance) {
                           const auto& laws = std::get<LawSet>(instance.param);
                           return laws.normal + "_" + laws.tangential + "_" + laws.rolling + "_" + std::to_string(std::get<int>(instance.param)) + "d";
                         });

TEST(Packs, AreLoadedFromAndStoredAtAnyAddress) {
  // Regression: the compiler took the address for an aligned one; walls of glued particles then crashed, by the allocator's chance.
  std::vector<double> numbers(3 * lanes), copy(3 * lanes);
  for (std::size_t n = 0; n < numbers.size(); ++n) numbers[n] = static_cast<double>(n);
  for (std::size_t at = 0; at < lanes; ++at) {
    const double* from = &numbers[at];
    asm volatile("" : "+r"(from));  // an address that the compiler knows nothing of
    store(&copy[at], 2.0 * load(from));
    for (std::size_t lane = 0; lane < lanes; ++lane) EXPECT_EQ(copy[at + lane], 2.0 * static_cast<double>(at + lane));
  }
}

TEST(LawsTable, IsTheOneInTheDocs) {
  std::ifstream file(ACOPLA_SOURCE_DIR "/docs/laws.md");
  std::stringstream page;
  page << file.rdbuf();
  const std::string begin = "<!-- acopla-dem --laws -->\n", end = "<!-- end -->";
  const auto from = page.str().find(begin), to = page.str().find(end);
  ASSERT_NE(from, std::string::npos);
  EXPECT_EQ(page.str().substr(from + begin.size(), to - from - begin.size()), laws_table(Laws::built_in()))
      << "docs/laws.md is behind: put what acopla-dem --laws prints between its two marks";
}

}  // namespace
}  // namespace acopla::dem::test
