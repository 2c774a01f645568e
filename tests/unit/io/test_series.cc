// Series: what is written is read back bit for bit, also after a writer that never closed its file.
#include <sys/resource.h>
#include <sys/wait.h>

#include <cmath>
#include <csignal>

#include "io/series.h"
#include "tests/unit/io/scratch.h"

namespace acopla::io {
namespace {

using geometry::Vec3;

geometry::SurfaceMesh surface() {
  geometry::SurfaceMesh mesh;
  for (int k = 0; k < 4; ++k) mesh.points.emplace_back(k % 2, k / 2, 0.1);
  mesh.add_face(geometry::FaceKind::triangle3, std::vector<std::uint32_t>{0, 1, 3});
  mesh.add_face(geometry::FaceKind::quad4, std::vector<std::uint32_t>{0, 1, 3, 2});
  return mesh;
}

std::vector<Vec3> force(int window) {
  std::vector<Vec3> values;
  for (int k = 0; k < 4; ++k) values.emplace_back(window + 0.1, k, 1.0 / 3 * window);
  return values;
}

void write_windows(SeriesWriter& writer, int windows) {
  writer.add_surface("grains.box", surface());
  for (int k = 0; k < windows; ++k) {
    writer.begin_window(0.1 * k, 0.1 * (k + 1));
    writer.add_field("grains.box", "force", force(k));
    writer.add_scalar("ledger/force_loss", 1e-16 * k);
    if (k >= 2) writer.add_scalar("quantities/late", k);
    writer.flush();
  }
}

void expect_windows(const std::string& path, std::size_t windows) {
  const SeriesReader reader(path);
  ASSERT_EQ(reader.windows(), windows);
  EXPECT_EQ(reader.surfaces(), std::vector<std::string>{"grains.box"});
  const auto mesh = reader.surface("grains.box");
  EXPECT_EQ(mesh.points, surface().points);
  EXPECT_EQ(mesh.kinds(), surface().kinds());
  EXPECT_EQ(mesh.connectivity(), surface().connectivity());
  for (std::size_t k = 0; k < windows; ++k)
    EXPECT_EQ(reader.field("grains.box", "force", k), force(static_cast<int>(k)));
  EXPECT_EQ(reader.window(1), (std::pair<double, double>{0.1, 0.2}));
  EXPECT_EQ(reader.scalars("ledger/force_loss").size(), windows);
}

using Series = Scratch;

TEST_F(Series, WhatIsWrittenIsReadBitForBit) {
  {
    SeriesWriter writer(path("a.h5"));
    write_windows(writer, 7);
  }
  expect_windows(path("a.h5"), 7);
}

TEST_F(Series, AWindowWithoutAValueIsNotANumber) {
  {
    SeriesWriter writer(path("a.h5"));
    write_windows(writer, 4);
  }
  const auto late = SeriesReader(path("a.h5")).scalars("quantities/late");
  ASSERT_EQ(late.size(), 4u);
  EXPECT_TRUE(std::isnan(late[0]) && std::isnan(late[1]));
  EXPECT_EQ(late[2], 2);
}

TEST_F(Series, AWriterThatIsKilledLeavesAllFlushedWindows) {
  const auto file = path("killed.h5");
  const pid_t child = fork();
  if (child == 0) {
    SeriesWriter writer(file);
    write_windows(writer, 5);
    kill(getpid(), SIGKILL);
  }
  waitpid(child, nullptr, 0);
  expect_windows(file, 5);
}

// Whatever window the disk is full at, and wherever in it.
TEST_F(Series, AFullDiskLeavesAllFlushedWindows) {
  for (rlim_t room = 100'000; room < 240'000; room += 9'731) {
    const auto file = path("full" + std::to_string(room) + ".h5");
    const pid_t child = fork();
    if (child == 0) {
      signal(SIGXFSZ, SIG_IGN);  // writing beyond the limit fails, as on a full disk
      const rlimit low{room, room};
      setrlimit(RLIMIT_FSIZE, &low);
      int flushed = 0;
      try {
        SeriesWriter writer(file);
        writer.add_surface("grains.box", surface());
        writer.flush();
        for (int k = 0;; ++k) {
          writer.begin_window(0.1 * k, 0.1 * (k + 1));
          writer.add_field("grains.box", "force", force(k));
          writer.add_scalar("ledger/force_loss", 1e-16 * k);
          for (int table = 0; k >= 2 && table < 5; ++table) writer.add_scalar("quantities/" + std::to_string(table * k), k);
          writer.flush();
          flushed = k + 1;
        }
      } catch (const UserError& error) {
        _exit(std::string(error.what()).find("cannot be written") != std::string::npos ? std::min(flushed, 254) : 255);
      }
    }
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status)) << room;
    ASSERT_NE(WEXITSTATUS(status), 255) << room;
    const SeriesReader reader(file);
    ASSERT_EQ(reader.windows(), static_cast<std::size_t>(WEXITSTATUS(status))) << room;
    for (int k = 0; k < WEXITSTATUS(status); ++k) EXPECT_EQ(reader.field("grains.box", "force", static_cast<std::size_t>(k)), force(k)) << room;
  }
}

TEST_F(Series, EmptySurfacesAreFine) {
  {
    SeriesWriter writer(path("a.h5"));
    writer.add_surface("none", {});
    writer.begin_window(0, 1);
    writer.add_field("none", "force", {});
    writer.flush();
  }
  const SeriesReader reader(path("a.h5"));
  EXPECT_TRUE(reader.surface("none").points.empty());
  EXPECT_TRUE(reader.field("none", "force", 0).empty());
}

TEST_F(Series, MistakesListWhatThereIs) {
  {
    SeriesWriter writer(path("a.h5"));
    write_windows(writer, 2);
  }
  const SeriesReader reader(path("a.h5"));
  expect_mistake([&] { reader.field("grains.box", "displacement", 0); },
                 "/grains.box/displacement is not in this record. It holds: connectivity, force,");
  expect_mistake([&] { reader.field("grains.bx", "force", 0); },
                 "/grains.bx/force is not in this record");
  expect_mistake([&] { reader.field("grains.box", "force", 2); }, "has no window 2");
  expect_mistake([&] { SeriesReader(path("none.h5")); }, "the record does not exist");
  expect_mistake([&] { SeriesReader(write("text.h5", "not HDF5")); }, "not a readable HDF5 record");
  expect_mistake([&] { SeriesWriter(path("no/such/a.h5")); }, "cannot be written");
  const auto whole = read("a.h5");
  for (const auto part : {whole.size() / 2, std::size_t{100}, std::size_t{0}})
    expect_mistake([&] { SeriesReader(write("cut.h5", whole.substr(0, part))); }, "cut.h5");
}

}  // namespace
}  // namespace acopla::io
