#include <gtest/gtest.h>

#include <diracstep/reports/json.hpp>
#include <limits>

namespace diracstep {
namespace {

TEST(Json, MembersKeepTheirOrder) {
  Json json;
  json["z"] = 1;
  add_member(json, "a", 2);
  EXPECT_EQ(to_text(json), R"({"z":1,"a":2})");
  Json made;
  add_member(made, "only", Json::array());
  EXPECT_EQ(to_text(made), R"({"only":[]})");
}

TEST(Json, WhatIsNotFiniteBecomesNullAndWhatIsNoUtf8IsReplaced) {
  EXPECT_EQ(to_text(Json(std::numeric_limits<double>::quiet_NaN())), "null");
  EXPECT_EQ(to_text(Json(-std::numeric_limits<double>::infinity())), "null");
  EXPECT_EQ(to_text(Json("x\xff")), "\"x\xef\xbf\xbd\"");
}

}  // namespace
}  // namespace diracstep
