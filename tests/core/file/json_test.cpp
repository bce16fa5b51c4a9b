// SPDX-License-Identifier: Apache-2.0
// What the JSON reader says of values that are not what they should be, and where.
#include "core/file/json.h"

#include <nlohmann/json.hpp>

#include "support/catch.h"
#include "support/message_of.h"

using namespace tg;
using tg::test::messageOf;

TEST_CASE("a member that is missing or wrong is named with the file and the place") {
  const std::string path = "a.json";
  const nlohmann::json root = parseJson(R"({"s": 1, "n": "x", "i": 1.5, "l": [1, 2], "b": 0, "v": [1, "x"]})", path);
  const JsonNode node{root, path, "camera 3"};
  CHECK(messageOf([&] { node.member("q"); }) == "a.json: camera 3: missing key \"q\"");
  CHECK(messageOf([&] { node.string("s"); }) == "a.json: camera 3: \"s\": expected a string, found number");
  CHECK(messageOf([&] { node.number("n"); }) == "a.json: camera 3: \"n\": expected a number, found string");
  CHECK(messageOf([&] { node.number("i", 2, 3); }) == "a.json: camera 3: \"i\": expected 2 to 3, found 1.5");
  CHECK(messageOf([&] { node.integer("i", 0, 9); }) ==
        "a.json: camera 3: \"i\": expected an integer from 0 to 9, found 1.5");
  CHECK(messageOf([&] { node.integer("i", 2, 2); }) == "a.json: camera 3: \"i\": expected 2, found 1.5");
  CHECK(messageOf([&] { node.boolean("b"); }) == "a.json: camera 3: \"b\": expected true or false, found number");
  CHECK(messageOf([&] { node.array("l", 3); }) == "a.json: camera 3: \"l\": expected an array of 3");
  CHECK(messageOf([&] { node.list("l", 1); }) == "a.json: camera 3: \"l\": expected an array of at most 1");
  CHECK(messageOf([&] { node.numbers<2>("v"); }) == "a.json: camera 3: \"v\": expected a number, found string");
  CHECK(node.numbers<2>("l") == std::array<double, 2>{1, 2});
  CHECK(messageOf([&] { JsonNode{root["l"], path, ""}.member("q"); }) == "a.json: expected an object, found array");
}

TEST_CASE("places of a document are JSON pointers") {
  const std::string path = "a.gltf";
  const nlohmann::json root = parseJson(R"({"a": [{"b": -1}], "t": [1, "x"]})", path);
  const JsonNode node{root, path, "/"};
  CHECK(messageOf([&] { node.at("q"); }) == "a.gltf: /: \"q\" is missing");
  CHECK(messageOf([&] { node.array(); }).starts_with("a.gltf: /: wrong type (expected an array, found {"));
  const JsonNode entry = node.at("a").array().element(0).object();
  CHECK(messageOf([&] { entry.at("b").size64(); }) ==
        "a.gltf: /a/0/b: wrong value (expected an integer >= 0, found -1)");
  CHECK(entry.size64("c", 7) == 7);
  CHECK(messageOf([&] { node.at("t").element(0).index(1, "node"); }) ==
        "a.gltf: /t/0: no such node (expected an index below 1, found 1)");
  CHECK(messageOf([&] { node.at("t").expectNumbers(2); }) ==
        "a.gltf: /t: wrong value (expected 2 numbers, found [1,\"x\"])");
  CHECK(messageOf([&] { JsonNode{root["t"], path, "/"}.element(1).object(); }) ==
        "a.gltf: /1: wrong type (expected an object, found \"x\")");
  CHECK(messageOf([&] { node.at("t").element(0).string(); }) ==
        "a.gltf: /t/0: wrong type (expected a string, found 1)");
}

TEST_CASE("JSON that is broken or nests deeper than 64 levels is refused in the format's own words") {
  const auto nested = [](int levels) { return std::string(levels, '[') + "1" + std::string(levels, ']'); };
  CHECK(messageOf([&] { parseJson(nested(64), "a"); }) == "accepted");
  CHECK(messageOf([&] { parseJson(nested(65), "a"); }) == "a: JSON nests too deep (expected at most 64 levels)");
  CHECK(messageOf([&] { parseJson(nested(65), "a", {"broken: ", "deep"}); }) == "a: deep");
  CHECK(messageOf([&] { parseJson("\"" + std::string(100, '[') + "\\\"[\"", "a"); }) == "accepted");
  CHECK(messageOf([&] { parseJson(std::string(1'000'000, 'x'), "a"); }).size() < 400);
  CHECK(messageOf([&] { parseJson("{", "a"); }) == "a: not valid JSON: line 1, column 2, where it ends");
  CHECK(messageOf([&] { parseJson("", "a"); }) == "a: not valid JSON: line 1, column 1, where it ends");
  CHECK(messageOf([&] { parseJson("{\n \"a\": 1,\n \"b\": }", "a"); }) == "a: not valid JSON: line 3, column 7");
  CHECK(messageOf([&] { parseJson("{\"broken\n", "a"); }) == "a: not valid JSON: line 1, column 9");
  CHECK(messageOf([&] { parseJson("\x1f\x8b" + nested(70), "a"); }) == "a: not valid JSON: line 1, column 1");
  CHECK(messageOf([&] { parseJson(" \xef\xbb\xbf{}", "a"); }) != "a: JSON nests too deep (expected at most 64 levels)");
  CHECK(messageOf([&] { parseJson("\xef\xbb\xbf{}", "a"); }) == "accepted");
  CHECK(messageOf([&] { parseJson("{} x", "a", {"broken: ", "deep"}); }).starts_with("a: broken: "));
}

TEST_CASE("a number beyond doubles in JSON is refused with its place") {
  CHECK(messageOf([&] { parseJson("{\n \"a\": [1, -1e999]}", "a"); }) ==
        "a: not valid JSON: line 2, column 11: number out of range (expected a magnitude of at most 1.8e308, found "
        "-1e999)");
  CHECK_THAT(messageOf([&] { parseJson(R"({"1e999": "\"1e999", "a": 1e999})", "a"); }),
             Contains("line 1, column 27: number"));
  const std::string digits(1'000'000, '9');
  CHECK(messageOf([&] { parseJson("[" + digits + "]", "a"); }) ==
        "a: not valid JSON: line 1, column 2: number out of range (expected a magnitude of at most 1.8e308, found " +
            digits.substr(0, 20) + "..." + digits.substr(0, 10) + ")");
}
