#include <gtest/gtest.h>

#include <diracstep/files/json.hpp>
#include <limits>
#include <nlohmann/json.hpp>

namespace diracstep {
namespace {

/// What another implementation makes of the text.
nlohmann::ordered_json read_back(const Json& json, int indent = -1) {
  return nlohmann::ordered_json::parse(json.dump(indent));
}

TEST(Json, ListsOfPairsAreObjectsAndOthersArrays) {
  EXPECT_EQ((Json{{"a", 1}, {"b", {{"c", nullptr}}}}).dump(), R"({"a":1,"b":{"c":null}})");
  EXPECT_EQ((Json{1, 2.5, "x", true}).dump(), R"([1,2.5,"x",true])");
  EXPECT_EQ((Json{{"a", Json::array()}}).dump(), R"({"a":[]})");
  EXPECT_EQ(Json(std::vector<std::string>{"p", "q"}).dump(), R"(["p","q"])");
}

TEST(Json, MembersKeepTheirOrderAndAreFoundAgain) {
  Json json;
  json["z"] = 1;
  json["a"]["b"] = 2;
  json["z"] = 3;
  json["list"].push_back("x");
  json.add("last", Json::object());
  EXPECT_EQ(json.dump(), R"({"z":3,"a":{"b":2},"list":["x"],"last":{}})");
  EXPECT_FALSE(json.empty());
  EXPECT_TRUE(Json().empty());
}

TEST(Json, NumbersReadBackAsTheSameBits) {
  for (const double value : {0.1, 1.0, -3.0, 1e-300, 1.7976931348623157e308, 5e-324, 123456789.0, 1e22}) {
    EXPECT_EQ(read_back(Json(value)).get<double>(), value);
    EXPECT_TRUE(read_back(Json(value)).is_number_float()) << Json(value).dump();
  }
  EXPECT_TRUE(read_back(Json(7)).is_number_integer());
  EXPECT_EQ(read_back(Json(std::numeric_limits<long long>::min())).get<long long>(),
            std::numeric_limits<long long>::min());
  EXPECT_EQ(Json(std::numeric_limits<double>::quiet_NaN()).dump(), "null");
  EXPECT_EQ(Json(-std::numeric_limits<double>::infinity()).dump(), "null");
}

TEST(Json, TextsAreEscapedAndWhatIsNoUtf8Replaced) {
  const std::string text = "a\"b\\c\n\t\x01 \xc3\xa4 </script>";
  EXPECT_EQ(read_back(Json(text)).get<std::string>(), text);
  EXPECT_EQ(read_back(Json("x\xff\xc3")).get<std::string>(), "x\xef\xbf\xbd\xef\xbf\xbd");
  Json json;
  json.add("ke\"y", 1);
  EXPECT_TRUE(read_back(json).contains("ke\"y"));
}

TEST(Json, IndentedTextHoldsTheSame) {
  const Json json{{"a", {1, 2}}, {"b", Json::object()}, {"c", {{"d", "e"}}}};
  EXPECT_EQ(json.dump(2),
            "{\n  \"a\": [\n    1,\n    2\n  ],\n  \"b\": {},\n  \"c\": {\n    \"d\": \"e\"\n  }\n}");
  EXPECT_EQ(read_back(json, 2), read_back(json));
}

}  // namespace
}  // namespace diracstep
