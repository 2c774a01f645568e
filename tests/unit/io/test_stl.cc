// STL files as exporters write them, and as they arrive when something went wrong.
#include <cmath>
#include <cstring>

#include "io/stl.h"
#include "tests/unit/io/scratch.h"

namespace acopla::io {
namespace {

using Stl = Scratch;

std::string facet(const std::string& a, const std::string& b, const std::string& c) {
  return "facet normal 0 0 1\n outer loop\n vertex " + a + "\n vertex " + b + "\n vertex " + c +
         "\n endloop\nendfacet\n";
}

// A unit square of two triangles.
const std::string ascii = "solid square\n" + facet("0 0 0", "1 0 0", "1 1 0") +
                          facet("0 0 0", "1 1 0", "0 +1e0 -0") + "endsolid square\n";

void expect_square(const TriangleMesh& mesh) {
  ASSERT_EQ(mesh.triangles.size(), 2u);
  EXPECT_EQ(mesh.points.size(), 4u);  // six corners, welded
  EXPECT_EQ(mesh.dropped, 0u);
  EXPECT_EQ(mesh.points[mesh.triangles[1][2]], geometry::Vec3(0, 1, 0));
  EXPECT_EQ(mesh.surface().face_count(), 2u);
}

TEST_F(Stl, Ascii) { expect_square(read_stl(write("a.stl", ascii))); }

TEST_F(Stl, AsciiWithWindowsLineEndsAndNoName) {
  std::string text;
  for (const char c : ascii) text += c == '\n' ? std::string("\r\n") : std::string(1, c);
  expect_square(read_stl(write("a.stl", text)));
}

TEST_F(Stl, BinaryRoundTrip) {
  write_stl(path("b.stl"), read_stl(write("a.stl", ascii)));
  EXPECT_EQ(std::filesystem::file_size(path("b.stl")), 84u + 2 * 50);
  expect_square(read_stl(path("b.stl")));
}

TEST_F(Stl, ABinaryFileMayBeginWithSolid) {
  write_stl(path("b.stl"), read_stl(write("a.stl", ascii)));
  auto bytes = read("b.stl");
  bytes.replace(0, 5, "solid");
  expect_square(read_stl(write("c.stl", bytes)));
}

TEST_F(Stl, CutShort) {
  write_stl(path("b.stl"), read_stl(write("a.stl", ascii)));
  const auto bytes = read("b.stl");
  for (std::size_t length = 1; length < bytes.size(); ++length)
    EXPECT_THROW(read_stl(write("cut.stl", bytes.substr(0, length))), UserError) << length;
  const auto end = ascii.find("endsolid");
  for (std::size_t length = 1; length < end; ++length)
    EXPECT_THROW(read_stl(write("cut.stl", ascii.substr(0, length))), UserError) << length;
}

TEST_F(Stl, NothingInIt) {
  expect_mistake([&] { read_stl(path("none.stl")); }, "the STL file cannot be read");
  expect_mistake([&] { read_stl(write("e.stl", "")); }, "the STL file is empty");
  expect_mistake([&] { read_stl(write("e.stl", std::string(84, '\0'))); }, "holds no triangle");
  expect_mistake([&] { read_stl(write("e.stl", "solid x\nendsolid x\n")); }, "no triangle is left");
  expect_mistake([&] { read_stl(write("e.stl", "MZ something else")); },
                 "neither ASCII nor binary STL");
}

TEST_F(Stl, DegenerateTrianglesAreDroppedAndCounted) {
  const auto mesh = read_stl(
      write("d.stl", "solid\n" + facet("0 0 0", "1 0 0", "1 1 0") +
                         facet("0 0 0", "0 0 0", "1 1 0") + facet("0 0 0", "1 0 0", "2 0 0") +
                         facet("0 0 0", "1 0 0", "0.5 1e-12 0") + "endsolid\n"));
  EXPECT_EQ(mesh.triangles.size(), 1u);
  EXPECT_EQ(mesh.dropped, 3u);
  expect_mistake(
      [&] {
        read_stl(write("d.stl", "solid\n" + facet("0 0 0", "0 0 0", "1 1 0") + "endsolid\n"));
      },
      "all degenerate");
}

TEST_F(Stl, WhatIsNotANumber) {
  expect_mistake(
      [&] {
        read_stl(write("n.stl", "solid\n" + facet("0 0 x", "1 0 0", "1 1 0") + "endsolid\n"));
      },
      "n.stl:4:1: \"x\" is not a number");
  expect_mistake(
      [&] {
        read_stl(write("n.stl", "solid\n" + facet("0 0 nan", "1 0 0", "1 1 0") + "endsolid\n"));
      },
      "not a finite number");
  write_stl(path("b.stl"), read_stl(write("a.stl", ascii)));
  auto bytes = read("b.stl");
  const float bad = NAN;
  std::memcpy(bytes.data() + 84 + 12, &bad, 4);
  expect_mistake([&] { read_stl(write("n.stl", bytes)); },
                 "triangle 1 has a coordinate that is not a finite number");
}

}  // namespace
}  // namespace acopla::io
