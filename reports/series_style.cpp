#include <fmt/format.h>

#include <algorithm>
#include <diracstep/reports/series_style.hpp>

namespace diracstep {

std::string SeriesStyle::label() const { return fmt::format("{}, order {}", method, order); }

std::vector<SeriesStyle> series_styles(const std::vector<Study>& studies) {
  std::vector<SeriesStyle> styles;
  std::vector<std::string> methods;
  for (const Study& study : studies)
    for (const MeasuredOrder& ours : study.measured_orders) {
      const auto same = [&](const SeriesStyle& s) { return s.method == ours.method; };
      if (std::ranges::any_of(styles, [&](const auto& s) { return same(s) && s.order == ours.order; }))
        continue;
      if (std::ranges::find(methods, ours.method) == methods.end()) methods.push_back(ours.method);
      const auto colour = std::ranges::find(methods, ours.method) - methods.begin();
      styles.push_back({ours.method, ours.order, static_cast<std::size_t>(colour), styles.size()});
    }
  return styles;
}

}  // namespace diracstep
