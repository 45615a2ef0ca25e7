#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace diracstep::command {

/// An order as docs/orders.md has it, measured on a class of scenes.
struct PublishedOrder {
  std::string scene_class;
  double slope;
};

/// Those of a method at an order; empty where the table has none: its error is at round-off before it shows.
std::vector<PublishedOrder> published_orders(const std::string& method, int order);

/// The same of any text with such a table: "| `METHOD` | ORDER | SLOPE | …" below "| method | claimed | CLASS
/// …".
std::vector<PublishedOrder> published_orders(std::string_view text, const std::string& method, int order);

}  // namespace diracstep::command
