#pragma once

#include <string_view>

/// The files of study_page/, as they stand.
namespace diracstep::study_page_parts {

extern const std::string_view style, plot, motion, page;

}  // namespace diracstep::study_page_parts
