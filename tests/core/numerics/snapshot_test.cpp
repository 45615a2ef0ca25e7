#include <gtest/gtest.h>

#include <cmath>
#include <diracstep/core/numerics/snapshot.hpp>

#include "misuse.hpp"

namespace diracstep {
namespace {

using testing::expect_misuse;

Snapshot example() {
  Snapshot snapshot;
  snapshot.section("step");
  snapshot.put("count", 3.0);
  snapshot.put("scales", Vector{{0.1, -0.0, 1e-310}});
  snapshot.put_extended("rest", ExtendedVector{{1.0L / 3.0L, -1e-25L}});
  return snapshot;
}

void read(SnapshotReader& from) {
  from.section("step");
  EXPECT_EQ(from.whole_number("count", 5), 3);
  Vector scales(3);
  from.read("scales", scales);
  EXPECT_EQ(scales, (Vector{{0.1, -0.0, 1e-310}}));
  EXPECT_TRUE(std::signbit(scales[1]));
  ExtendedVector rest(2);
  from.read_extended("rest", rest);
  EXPECT_EQ(rest, (ExtendedVector{{1.0L / 3.0L, -1e-25L}}));
  from.require_end();
}

TEST(Snapshot, ReadsBackBitByBitAlsoFromBytes) {
  const Snapshot snapshot = example(), copy = Snapshot::from_bytes(snapshot.bytes());
  for (const Snapshot* from : {&snapshot, &copy}) {
    SnapshotReader reader(*from);
    read(reader);
  }
  EXPECT_EQ(copy.bytes(), snapshot.bytes());
  EXPECT_EQ(Snapshot::from_bytes(Snapshot().bytes()).fields().size(), 0U);
}

TEST(Snapshot, FieldsOfAnotherNameSizeOrValueAreRefusedByName) {
  const Snapshot snapshot = example();
  const auto refused = [&](auto wrong, std::initializer_list<std::string> parts) {
    SnapshotReader from(snapshot);
    from.section("step");
    expect_misuse([&] { wrong(from); }, parts);
  };
  refused([](SnapshotReader& from) { (void)from.number("size"); }, {"'count'", "'size' is needed"});
  refused([](SnapshotReader& from) { from.section("count"); }, {"1 numbers for 'count'", "0 are needed"});
  refused([](SnapshotReader& from) { (void)from.whole_number("count", 2); },
          {"3 for 'count'", "from 0 to 2"});
  refused([](SnapshotReader& from) { (void)from.flag("count"); }, {"3 for 'count'", "from 0 to 1"});
  refused(
      [](SnapshotReader& from) {
        (void)from.number("count");
        Vector four(4);
        from.read("scales", four);
      },
      {"3 numbers for 'scales'", "4 are needed"});
  refused([](SnapshotReader& from) { from.require_end(); }, {"goes on with 'count'"});
  const Snapshot empty;
  SnapshotReader at_end(empty);
  expect_misuse([&] { (void)at_end.number("time"); }, {"ends before 'time'"});
}

TEST(Snapshot, BytesOfAnotherLayoutOrDamagedOnesAreRefused) {
  const std::string bytes = example().bytes();
  const auto refused = [](const std::string& bad, std::initializer_list<std::string> parts) {
    expect_misuse([&] { (void)Snapshot::from_bytes(bad); }, parts);
  };
  refused("", {"no snapshot"});
  refused("diracstep checkpoint 1\n", {"no snapshot"});
  refused("diracstep snapshot 99\n" + bytes.substr(bytes.find('\n') + 1), {"layout 99", "reads layout 1"});
  refused("diracstep snapshot 1\n3 scales", {"cut off"});
  refused("diracstep snapshot 1\nscales\n\n", {"'scales'"});
  refused("diracstep snapshot 1\n18446744073709551615 scales\n\n", {"18446744073709551615 scales"});
  refused("diracstep snapshot 1\n-1 scales\n\n", {"-1 scales"});
  refused(bytes + "x", {"8 numbers", "65 bytes"});
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW((void)Snapshot::from_bytes(std::string_view(bytes).substr(0, size)), Misuse) << size;
}

}  // namespace
}  // namespace diracstep
