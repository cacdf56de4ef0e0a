// SPDX-License-Identifier: Apache-2.0
// Mutates JSON as a tree; random changes of bytes rarely pass the parser.
#include <cstdint>
#include <cstring>
#include <random>

#include "helicarm/core/json.h"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* bytes, std::size_t size, std::size_t most);

namespace helicarm::fuzz {
namespace {

using Random = std::minstd_rand;

std::size_t below(Random& random, std::size_t count) { return random() % count; }

void collect(Json& json, std::vector<Json*>& nodes) {
  nodes.push_back(&json);
  if (json.is_structured())
    for (Json& child : json) collect(child, nodes);
}

Json& any_node(Json& json, Random& random) {
  std::vector<Json*> nodes;
  collect(json, nodes);
  return *nodes[below(random, nodes.size())];
}

std::string changed(std::string text) {
  const std::size_t size = text.size();
  text.resize(size + 16);
  text.resize(LLVMFuzzerMutate(reinterpret_cast<std::uint8_t*>(text.data()), size, text.size()));
  return text;
}

Json changed_number(double number, Random& random) {
  const double values[] = {0,
                           -0.0,
                           1,
                           -1,
                           0.5,
                           1e-300,
                           1e300,
                           -1e300,
                           65535,
                           65536,
                           2147483648.0,
                           4294967296.0,
                           number + 1,
                           number - 1,
                           -number,
                           number * 1.0001,
                           number / 2,
                           number * 1e6,
                           std::nextafter(number, 1e300)};
  return values[below(random, std::size(values))];
}

Json other_value(Random& random) {
  const Json values[] = {nullptr,
                         true,
                         0,
                         1,
                         -1,
                         1e300,
                         "",
                         "ball",
                         Json::array(),
                         Json::object(),
                         Json::array({1, 2, 3}),
                         Json::array({Json::array({1})})};
  return values[below(random, std::size(values))];
}

void change(Json& root, Random& random) {
  Json& node = any_node(root, random);
  switch (below(random, 6)) {
    case 0:
      node = other_value(random);
      break;
    case 1:
      node = Json(any_node(root, random));
      break;
    case 2:
      if (node.is_structured() && !node.empty()) {
        auto at = node.begin();
        std::advance(at, std::ptrdiff_t(below(random, node.size())));
        node.erase(at);
      }
      break;
    case 3:
      if (node.is_array() && !node.empty()) node.push_back(Json(node[below(random, node.size())]));
      if (node.is_object()) node[node.empty() ? "a" : changed(node.begin().key())] = other_value(random);
      break;
    default:
      if (node.is_number()) node = changed_number(node.get<double>(), random);
      if (node.is_string()) node = changed(node.get<std::string>());
      if (node.is_boolean()) node = !node.get<bool>();
  }
}

}  // namespace
}  // namespace helicarm::fuzz

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* bytes, std::size_t size, std::size_t most,
                                               unsigned seed) {
  using namespace helicarm;
  fuzz::Random random(seed);
  auto json = parse_json({reinterpret_cast<const char*>(bytes), size}, "");
  if (!json || fuzz::below(random, 20) == 0) return LLVMFuzzerMutate(bytes, size, most);
  for (std::size_t changes = 1 + fuzz::below(random, 4); changes-- > 0;) fuzz::change(*json, random);
  const std::string text = json->dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > most) return LLVMFuzzerMutate(bytes, size, most);
  std::memcpy(bytes, text.data(), text.size());
  return text.size();
}
