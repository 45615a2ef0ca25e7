#pragma once

#include <diracstep/reports/json.hpp>
#include <diracstep/validation/studies/convergence_study.hpp>
#include <vector>

namespace diracstep {

/// {"studies": [...], "build": {...}}, of which studies_json() is the text.
Json studies_document(const std::vector<Study>& studies);

}  // namespace diracstep
