#include "fem/settings.h"

#include <gtest/gtest.h>

#include "gmsh_writer.h"

namespace acopla::fem::test {
namespace {

std::string case_text(const std::string& mesh, const std::string& more = "") {
  return "dimension = 3\n[structure]\nsolver = \"fem\"\nmesh = \"" + mesh +
         "\"\n[structure.material]\nyoung = 2.1e11\npoisson = 0.3\n" + more;
}

Settings read(const std::string& text) {
  return read_settings(io::Table::from_text(text, "case.toml"), "structure");
}

std::string failure(const std::string& text) {
  try {
    read(text);
  } catch (const io::UserError& error) {
    return error.what();
  }
  return "no error";
}

class CaseTable : public testing::Test {
 protected:
  std::string mesh_ = write_block("block");
  std::string with(const std::string& more) const { return case_text(mesh_, more); }
  static void expect(const std::string& text, const std::vector<std::string>& parts) {
    const auto found = failure(text);
    for (const auto& part : parts) EXPECT_NE(found.find(part), std::string::npos) << found;
  }
};

TEST_F(CaseTable, HasDefaults) {
  const auto settings = read(with("[structure.fix.z0]\n"));
  EXPECT_EQ(settings.degree, 2);
  EXPECT_EQ(settings.solver.kind, SolverOptions::Kind::automatic);
  EXPECT_EQ(settings.solver.memory_limit, 4.0 * (1ull << 30));
  ASSERT_EQ(settings.materials.size(), 1u);
  EXPECT_FALSE(settings.materials[0].material.density.has_value());
  EXPECT_FALSE(settings.motion.has_value());
  EXPECT_TRUE(settings.loads.empty());
  EXPECT_TRUE(settings.vtu);
  EXPECT_FALSE(settings.every.has_value());
  ASSERT_EQ(settings.supports.size(), 1u);
  EXPECT_EQ(settings.supports[0].part.groups, std::vector<std::string>{"z0"});
  EXPECT_FALSE(settings.supports[0].moves);
  EXPECT_EQ(settings.supports[0].directions, (std::array{true, true, true}));
}

TEST_F(CaseTable, ReadsDirections) {
  const auto settings = read(with("[structure.fix.z0]\ndirections = [\"x\", \"z\"]\n"));
  EXPECT_EQ(settings.supports[0].directions, (std::array{true, false, true}));
  expect(with("[structure.fix.z0]\ndirections = [\"w\"]\n"),
         {"case.toml:9:", "structure.fix.z0.directions has \"w\""});
  expect(with("[structure.fix.z0]\ndirections = []\n"), {"is empty"});
}

TEST_F(CaseTable, RefusesASurfaceThatTheMeshDoesNotHave) {
  expect(with("[structure.fix.zo]\n"),
         {"case.toml:8:", "structure.fix.zo is not in the mesh.",
          "The mesh has the surfaces x0, x1, y0, y1, z0, z1.", "Did you mean \"z0\"?"});
}

TEST_F(CaseTable, RefusesAStructureWithoutAnyFix) {
  expect(with(""), {"structure has no table fix", "[structure.fix.SURFACE]"});
}

TEST_F(CaseTable, RefusesUnknownKeysAndNamesTheNearest) {
  expect(with("densty = 7850\n[structure.fix.z0]\n"), {"densty", "density"});
  expect(with("[structure.fix.z0]\n[structure.output]\nvtk = true\n"), {"vtk", "vtu"});
}

TEST_F(CaseTable, RefusesMaterialsThatCannotBe) {
  expect("dimension = 3\n[structure]\nmesh = \"" + mesh_ +
             "\"\n[structure.material]\nyoung = 1e9\npoisson = 0.5\n[structure.fix.z0]\n",
         {"case.toml:6:", "structure.material.poisson", "(-1, 0.5)"});
  expect("dimension = 3\n[structure]\nmesh = \"" + mesh_ +
             "\"\n[structure.material]\nyoung = 0\npoisson = 0.2\n[structure.fix.z0]\n",
         {"structure.material.young"});
}

TEST_F(CaseTable, RefusesAMeshFileThatIsNotThere) {
  expect(
      "dimension = 3\n[structure]\nmesh = \"/nowhere.msh\"\n[structure.material]\nyoung = 1\n"
      "poisson = 0\n",
      {"case.toml:3:", "nowhere.msh"});
}

}  // namespace
}  // namespace acopla::fem::test
