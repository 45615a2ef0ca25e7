#pragma once

#include <diracstep/validation/studies/convergence_study.hpp>
#include <string>
#include <vector>

namespace diracstep {

/// How the curve of a method at an order is drawn on every picture: the colour belongs to the method; marker
/// and dashes are those of the curve alone, so that they tell curves apart in grey print too.
struct SeriesStyle {
  std::string method;
  int order = 0;
  std::size_t colour = 0;  ///< the place of the method among all methods
  std::size_t marker = 0;  ///< the place of the curve among all

  std::string label() const;
};

/// The styles of all series of ours, as they first appear.
std::vector<SeriesStyle> series_styles(const std::vector<Study>& studies);

}  // namespace diracstep
