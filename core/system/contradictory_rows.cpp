#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/system/contradictory_rows.hpp>
#include <diracstep/core/system/detail/poses.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <iterator>
#include <sstream>
#include <unordered_map>
#include <unordered_set>

namespace diracstep {

namespace {

constexpr int most_rows = 100;
constexpr double differs = 1e-6;  // relative, so that rows differenced by plugins agree

}  // namespace

/// The dependent rows of a scene beside the others.
class RowsBesideOthers {
 public:
  RowsBesideOthers(const Scene& scene, const std::vector<std::string>& dependent)
      : names_(scene.row_names()),
        n_(scene.dimension()),
        space_(scene.space.get()),
        rows_(scene.constraints, n_),
        others_(only_holonomic(without_rows(scene, dependent)->constraints)),
        all_(only_holonomic(scene.constraints)) {
    const std::unordered_set<std::string> left_out(dependent.begin(), dependent.end());
    for (std::size_t r = 0; r < names_.size(); ++r) {
      const bool is_dependent = left_out.contains(names_[r]);
      (is_dependent ? these_ : those_).push_back(static_cast<int>(r));
      if (!is_dependent) kept_.push_back(names_[r]);
    }
    holonomic_these_ = only_holonomic(without_rows(scene, kept_)->constraints);
  }

  std::vector<std::string> combined(int row, double t, const Vector& q) {
    if (those_.empty()) return {};
    rows_.evaluate(t, q);
    const Columns a = rows_.pattern().full(rows_.coefficients());
    return names_in(Eigen::CompleteOrthogonalDecomposition<Columns>(one_forms_of_others(a))
                        .solve(a.row(row).transpose()));
  }

  /// Empty, or what contradicts at this time, from a pose near q.
  std::string at(double t, const Vector& near) {
    const auto pose = pose_near(space_, others_, t, near, {});
    if (!pose || !pose->allFinite()) return {};
    if (std::string rates = different_rates(t, *pose); !rates.empty()) return rates;
    return no_common_pose(t, *pose, std::max(max_norm(*pose), max_norm(near)));
  }

  std::string different_rates_near(double t, const Vector& near) {
    const auto pose = pose_near(space_, others_, t, near, {});
    return pose && pose->allFinite() ? different_rates(t, *pose) : std::string();
  }

  /// Empty, or that a point of the others is off these.
  std::string left_at(double t, const Vector& q) {
    const double off = distance_of(holonomic_these_, t, q, max_norm(q));
    if (off <= differs || off_as_others(t, q)) return {};
    std::ostringstream text;
    text << "'" << holonomic_these_.front()->names().front() << "' is not met at t = " << t << ", by " << off
         << " of its size, where the other rows are";
    return text.str();
  }

  std::string different_rates(double t, const Vector& q) {
    rows_.evaluate(t, q);
    const Columns a = rows_.pattern().full(rows_.coefficients());
    Vector b = Vector::Zero(rows_.rows());
    rows_.velocity_residual(Vector::Zero(n_), b);
    if (!a.allFinite() || !b.allFinite()) return {};
    const Columns others = one_forms_of_others(a);
    const Eigen::CompleteOrthogonalDecomposition<Columns> solver(others);
    for (const int row : these_) {
      const Vector one_form = a.row(row).transpose(), c = solver.solve(one_form);
      if (max_norm(others * c - one_form) > differs * max_norm(one_form)) continue;  // independent here
      double by_others = 0.0, terms = std::abs(b[row]);
      for (std::size_t k = 0; k < those_.size(); ++k) {
        const double term = c[static_cast<Eigen::Index>(k)] * b[those_[k]];
        by_others += term;
        terms += std::abs(term);
      }
      if (!(std::abs(b[row] - by_others) > differs * terms)) continue;
      std::ostringstream text;
      text << named(row, c) << ": at t = " << t << " the one demands a rate of " << -b[row]
           << " of what the other" << (several_ ? "s demand" : " demands") << " a rate of " << -by_others;
      return text.str();
    }
    return {};
  }

 private:
  /// Poses that the others allow are none of these rows, and none is found that all allow.
  std::string no_common_pose(double t, const Vector& q, double size) {
    const double off = distance_of(holonomic_these_, t, q, size);
    if (!(off > differs)) return {};
    const auto common = pose_near(space_, all_, t, q, {});
    if (!common || !(distance_of(all_, t, *common, size) > differs)) return {};
    rows_.evaluate(t, q);
    std::ostringstream text;
    text << "'" << names_[static_cast<std::size_t>(these_.front())] << "' contradicts "
         << (kept_.size() == 1 ? "'" + kept_.front() + "'" : "the other rows") << ": at t = " << t
         << " no pose is found that fulfils all of them";
    return text.str();
  }

  Columns one_forms_of_others(const Columns& a) const {
    Columns others(n_, static_cast<Eigen::Index>(those_.size()));
    for (std::size_t k = 0; k < those_.size(); ++k)
      others.col(static_cast<Eigen::Index>(k)) = a.row(those_[k]).transpose();
    return others;
  }

  /// The others with a part in a combination.
  std::vector<std::string> names_in(const Vector& combination) const {
    std::vector<std::string> names;
    for (std::size_t k = 0; k < those_.size(); ++k)
      if (std::abs(combination[static_cast<Eigen::Index>(k)]) > differs * max_norm(combination))
        names.push_back(names_[static_cast<std::size_t>(those_[k])]);
    return names;
  }

  /// "'a' contradicts 'b', 'c'".
  std::string named(int row, const Vector& combination) {
    const std::vector<std::string> others = names_in(combination);
    several_ = others.size() > 1;
    std::string text = "'" + names_[static_cast<std::size_t>(row)] + "' contradicts ";
    for (const std::string& other : others) text += (&other == &others.front() ? "'" : ", '") + other + "'";
    return text;
  }

  /// Whether these rows are combinations of the others here and off by as much as those are: all positions
  /// that are held may be zero, and then nothing but round-off has a size.
  bool off_as_others(double t, const Vector& q) {
    constexpr double as_much = 10.0;
    std::unordered_map<std::string, double> distances;
    for (const auto& block : all_) {
      Vector phi(block->rows());
      block->position(t, q, phi);
      for (Eigen::Index r = 0; r < phi.size(); ++r)
        distances[block->names()[static_cast<std::size_t>(r)]] = std::abs(phi[r]);
    }
    const auto distance = [&](int row) {
      const auto found = distances.find(names_[static_cast<std::size_t>(row)]);
      return found != distances.end() ? found->second : 0.0;
    };
    rows_.evaluate(t, q);
    const Columns a = rows_.pattern().full(rows_.coefficients()), others = one_forms_of_others(a);
    const Eigen::CompleteOrthogonalDecomposition<Columns> solver(others);
    return std::ranges::all_of(these_, [&](int row) {
      const Vector one_form = a.row(row).transpose(), c = solver.solve(one_form);
      if (max_norm(others * c - one_form) > differs * max_norm(one_form)) return false;
      double by_others = 0.0;
      for (std::size_t k = 0; k < those_.size(); ++k)
        by_others += std::abs(c[static_cast<Eigen::Index>(k)]) * distance(those_[k]);
      return distance(row) <= as_much * by_others;
    });
  }

  /// Of positions of this size.
  static double distance_of(const ConstraintBlocks& blocks, double t, const Vector& q, double size) {
    double largest = 0.0;
    for (const auto& block : blocks) {
      Vector phi(block->rows()), a(block->pattern().nonzeros()), b(block->rows());
      block->position(t, q, phi);
      block->coefficients(t, q, a, b);
      largest = std::max(largest, max_norm(phi) / size_or_one(max_norm(a) * size));
    }
    return largest;
  }

  std::vector<std::string> names_, kept_;
  int n_;
  const Space* space_;
  ConstraintsAtPoint rows_;
  ConstraintBlocks others_, all_, holonomic_these_;
  std::vector<int> these_, those_;
  bool several_ = false;
};

std::string contradiction(const Scene& scene, const Start& start, const std::vector<std::string>& dependent) {
  if (dependent.empty() || scene.rows() > most_rows) return {};
  if (std::ssize(dependent) >= scene.rows()) return {};  // rows whose one-forms vanish, and no others
  RowsBesideOthers rows(scene, dependent);
  std::vector<double> times{start.time};
  for (int k = -12; k <= 12; ++k) times.push_back(start.time + std::pow(10.0, 0.5 * k));
  for (const double t : times)
    for (const double distance : {0.0, -0.1, 0.1})
      if (std::string text = rows.at(t, moved_start(scene.space.get(), start, distance)); !text.empty())
        return text;
  return {};
}

std::vector<std::string> combined_rows(const Scene& scene, const Start& start, const std::string& row,
                                       const std::vector<std::string>& dependent) {
  const std::vector<std::string> names = scene.row_names();
  const auto number = static_cast<int>(std::ranges::find(names, row) - names.begin());
  return RowsBesideOthers(scene, dependent).combined(number, start.time, start.q);
}

std::shared_ptr<const Scene> with_rows_left_out(const std::shared_ptr<const Scene>& scene,
                                                const std::vector<std::string>& dependent) {
  auto left = std::make_shared<Scene>(*without_rows(*scene, dependent));
  if (!left->whole) left->whole = scene;
  return left;
}

std::vector<std::string> rows_left_out(const Scene& scene) {
  const std::vector<std::string> all = scene.row_names();
  const std::unordered_set<std::string> kept(all.begin(), all.end());
  std::vector<std::string> names = scene.whole->row_names();
  std::erase_if(names, [&](const std::string& name) { return kept.contains(name); });
  return names;
}

LeftOutRows::LeftOutRows(const Scene& scene)
    : rows_(std::make_unique<RowsBesideOthers>(*scene.whole, rows_left_out(scene))),
      has_rates_(scene.whole->rows() <= most_rows &&
                 !std::ranges::all_of(scene.whole->constraints,
                                      [](const auto& block) { return block->workless(); })) {}

LeftOutRows::~LeftOutRows() = default;

std::string LeftOutRows::broken_at(double t, const Vector& q) {
  std::string text = has_rates_ ? rows_->different_rates(t, q) : std::string();
  return text.empty() ? rows_->left_at(t, q) : text;
}

std::string LeftOutRows::other_rates_near(double t, const Vector& q) {
  return has_rates_ ? rows_->different_rates_near(t, q) : std::string();
}

}  // namespace diracstep
