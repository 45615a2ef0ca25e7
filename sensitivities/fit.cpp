#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/sensitivities/fit.hpp>
#include <diracstep/sensitivities/sensitivities.hpp>
#include <limits>
#include <numbers>
#include <unsupported/Eigen/NonLinearOptimization>

namespace diracstep {

namespace {

constexpr const char* interrupted_fit = "interrupted";

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

/// Residuals for parameters whose motion cannot be computed: far larger than any, so that a search turns
/// back.
constexpr double no_motion = 1e100;

struct FittedMotion {
  std::string failure;               ///< empty, or why it has none
  Columns values;                    ///< as FitData::values
  std::vector<Columns> derivatives;  ///< of each row by the parameters, one line for each column
};

/// The motion at the times of the data.
class MotionAt {
 public:
  MotionAt(const FitProblem& problem, const FitData& data) : problem_(problem), data_(data) {}

  FittedMotion operator()(const Vector& parameters) {
    FittedMotion motion;
    try {
      outputs_ = outputs_at(parameters);
      compute(problem_.scene(parameters), motion);
    } catch (const Error& error) {
      motion.failure = error.what();
    }
    return motion;
  }

 private:
  void compute(const ParametricScene& scene, FittedMotion& motion) {
    Integrator integrator(scene.scene, problem_.registry, problem_.solvers, problem_.steps);
    Sensitivities sensitivities(integrator, problem_.registry, scene);
    Directions z = sensitivities.by_parameters();
    const double start = integrator.time();
    motion.values.resize(data_.values.rows(), data_.values.cols());
    double last = start;
    for (Eigen::Index k = 0; k < data_.times.size(); ++k) {
      const double way = data_.times[k] - last;
      const double count = std::max(1.0, std::ceil(std::abs(way / problem_.steps.step) * (1.0 - 1e-9)));
      for (double i = 0.0; way != 0.0 && i < count; ++i) {
        if (problem_.go_on && !problem_.go_on()) return void(motion.failure = interrupted_fit);
        const StepReport report = integrator.step(way / count);
        if (!report.ok()) return void(motion.failure = report.failure);
        sensitivities.follow(z);
      }
      last = data_.times[k];
      if (!read(integrator, sensitivities, z, k, motion)) return;
    }
  }

  bool read(Integrator& integrator, Sensitivities& sensitivities, const Directions& z, Eigen::Index k,
            FittedMotion& motion) const {
    Sample sample;
    if (!integrator.sample(Momentum::projected, sample).ok()) {
      motion.failure = "the velocity at t = " + to_text(integrator.time()) + " was not found";
      return false;
    }
    const ReadDirections moved = sensitivities.read(z);
    Columns& derivatives = motion.derivatives.emplace_back(data_.values.cols(), z.cols());
    for (std::size_t c = 0; c < data_.columns.size(); ++c) {
      const auto& [coordinate, velocity, sigma, output] = data_.columns[c];
      const auto column = static_cast<Eigen::Index>(c);
      if (output >= 0) {
        motion.values(k, column) = outputs_.at_parameters[number(output)](sample.point());
        derivatives.row(column) = output_derivatives(number(output), sample, moved);
        continue;
      }
      motion.values(k, column) = (velocity ? sample.v : sample.q)[coordinate];
      derivatives.row(column) = (velocity ? moved.v : moved.q).row(coordinate);
    }
    return true;
  }

  static std::size_t number(int output) { return static_cast<std::size_t>(output); }

  /// The outputs with the parameters, and with each a little more and less.
  struct Outputs {
    std::vector<PointFunction> at_parameters;
    std::vector<std::vector<PointFunction>> more, less;
    Vector change;
  };

  Outputs outputs_at(const Vector& parameters) const {
    Outputs outputs;
    if (std::ranges::none_of(data_.columns, [](const auto& column) { return column.output >= 0; }))
      return outputs;
    outputs.at_parameters = problem_.outputs(parameters);
    outputs.change = 1e-5 * (parameters.array() != 0.0).select(parameters.cwiseAbs(), 1.0);
    for (Eigen::Index i = 0; i < parameters.size(); ++i) {
      const Vector step = outputs.change[i] * Vector::Unit(parameters.size(), i);
      outputs.more.push_back(problem_.outputs(parameters + step));
      outputs.less.push_back(problem_.outputs(parameters - step));
    }
    return outputs;
  }

  /// Of an output along the motions of parameters a little off.
  Eigen::RowVectorXd output_derivatives(std::size_t output, const Sample& at,
                                        const ReadDirections& moved) const {
    Sample elsewhere = at;
    elsewhere.lambda.array() += 1.0;
    if (outputs_.at_parameters[output](at.point()) != outputs_.at_parameters[output](elsewhere.point()))
      throw Misuse("fit: an output that reads the forces of rows, which are not differentiated");
    Eigen::RowVectorXd derivatives(outputs_.change.size());
    const auto moved_by = [&](const std::vector<PointFunction>& functions, Eigen::Index i, double change) {
      Sample off = at;
      off.q += change * moved.q.col(i);
      off.p += change * moved.p.col(i);
      if (moved.v.rows() > 0) off.v += change * moved.v.col(i);
      return functions[output](off.point());
    };
    for (Eigen::Index i = 0; i < derivatives.size(); ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double change = outputs_.change[i];
      derivatives[i] =
          (moved_by(outputs_.more[k], i, change) - moved_by(outputs_.less[k], i, -change)) / (2.0 * change);
    }
    return derivatives;
  }

  const FitProblem& problem_;
  const FitData& data_;
  Outputs outputs_;
};

/// What lmder asks for.
class Residuals {
 public:
  Residuals(const FitProblem& problem, const FitData& data) : motion_at_(problem, data), data_(data) {
    for (Eigen::Index k = 0; k < data.values.rows(); ++k)
      for (Eigen::Index c = 0; c < data.values.cols(); ++c)
        if (!std::isnan(data.values(k, c))) measured_.emplace_back(k, c);
  }

  int values() const { return static_cast<int>(measured_.size()); }

  int operator()(const Vector& parameters, Vector& f) {
    at(parameters);
    for (int i = 0; i < values(); ++i) {
      const auto [k, c] = measured_[static_cast<std::size_t>(i)];
      f[i] = motion_.failure.empty() ? (motion_.values(k, c) - data_.values(k, c)) / sigma(c) : no_motion;
      if (!std::isfinite(f[i])) f[i] = no_motion;
    }
    return motion_.failure == interrupted_fit ? -1 : 0;
  }

  int df(const Vector& parameters, Columns& jacobian) {
    at(parameters);
    if (!motion_.failure.empty()) return -1;
    jacobian.resize(values(), parameters.size());
    for (int i = 0; i < values(); ++i) {
      const auto [k, c] = measured_[static_cast<std::size_t>(i)];
      jacobian.row(i) = motion_.derivatives[static_cast<std::size_t>(k)].row(c) / sigma(c);
    }
    clear_round_off(parameters, jacobian);
    return 0;
  }

  /// A parameter that cancels out of the motion, as the mass of a pendulum, has derivatives that are
  /// round-off of the motion: they determine nothing.
  void clear_round_off(const Vector& parameters, Columns& jacobian) const {
    constexpr double round_off = 1e-10;
    double size = 0.0;
    for (const auto& [k, c] : measured_) size = std::hypot(size, motion_.values(k, c) / sigma(c));
    for (Eigen::Index i = 0; i < parameters.size(); ++i) {
      const double unit = parameters[i] != 0.0 ? std::abs(parameters[i]) : 1.0;
      if (jacobian.col(i).norm() * unit <= round_off * size) jacobian.col(i).setZero();
    }
  }

  /// The motion there, once for the residuals and their derivatives.
  const FittedMotion& at(const Vector& parameters) {
    if (parameters_.size() != parameters.size() || parameters_ != parameters) {
      motion_ = motion_at_(parameters);
      parameters_ = parameters;
      ++evaluations_;
    }
    return motion_;
  }
  int evaluations() const { return evaluations_; }

 private:
  double sigma(Eigen::Index c) const { return data_.columns[static_cast<std::size_t>(c)].sigma; }

  MotionAt motion_at_;
  const FitData& data_;
  std::vector<std::pair<Eigen::Index, Eigen::Index>> measured_;
  Vector parameters_;
  FittedMotion motion_;
  int evaluations_ = 0;
};

void require_data(const FitData& data) {
  require_size("fit: columns of data", data.values.cols(), static_cast<long>(data.columns.size()));
  require_size("fit: rows of data", data.values.rows(), data.times.size());
  if (!data.times.allFinite()) throw Misuse("fit: a time is not finite");
  for (const FitData::Column& column : data.columns)
    if (!(column.sigma > 0.0 && std::isfinite(column.sigma)))
      throw Misuse("fit: a standard deviation is " + to_text(column.sigma) + "; a number above 0 is needed");
}

/// Times must lead on from the start in the direction of the steps.
void require_times(const FitData& data, double start, double step) {
  double last = start;
  for (const double t : data.times) {
    if ((t - last) * step < 0.0)
      throw Misuse("fit: t = " + to_text(t) + " does not follow t = " + to_text(last));
    last = t;
  }
}

std::string words(Eigen::LevenbergMarquardtSpace::Status status) {
  using namespace Eigen::LevenbergMarquardtSpace;
  switch (status) {
    case RelativeReductionTooSmall:
      return "the sum of squares changes no more";
    case RelativeErrorTooSmall:
    case RelativeErrorAndReductionTooSmall:
      return "the parameters change no more";
    case CosinusTooSmall:
    case GtolTooSmall:
      return "the gradient is zero to round-off";
    case FtolTooSmall:
    case XtolTooSmall:
      return "no smaller sum of squares can be told from round-off";
    case TooManyFunctionEvaluation:
      return "the evaluations allowed are used up";
    case UserAsked:
      return interrupted_fit;
    default:
      return "the search could not go on";
  }
}

void measure_uncertainty(const FitProblem& problem, Residuals& residuals, FitReport& report) {
  const auto count = report.parameters.size();
  Vector f(residuals.values());
  residuals(report.parameters, f);
  Columns jacobian;
  report.covariance = Columns::Constant(count, count, infinity);
  report.interval = Vector::Constant(count, infinity);
  report.residual = nan;
  if (residuals.df(report.parameters, jacobian) < 0) return;
  // In units of the columns, so that it does not matter what the parameters are measured in.
  const Vector norms = jacobian.colwise().norm().transpose();
  const Vector units = (norms.array() > 0.0).select(norms, 1.0);
  const Columns scaled = jacobian * units.cwiseInverse().asDiagonal();
  const Eigen::JacobiSVD<Columns> svd(scaled, Eigen::ComputeThinU | Eigen::ComputeFullV);
  const Vector& sizes = svd.singularValues();
  const Eigen::Index rank = (sizes.array() > 1e-10 * sizes[0]).count();
  const auto freedom = static_cast<double>(report.measured - rank);
  if (freedom <= 0.0) return;
  report.residual = std::sqrt(f.squaredNorm() / freedom);
  const Columns directions = svd.matrixV().leftCols(rank) * sizes.head(rank).cwiseInverse().asDiagonal();
  const Columns covariance = report.residual * report.residual * units.cwiseInverse().asDiagonal() *
                             (directions * directions.transpose()) * units.cwiseInverse().asDiagonal();
  // A parameter is determined where no direction that leaves the data as they are moves it.
  const Vector open = svd.matrixV().rightCols(count - rank).rowwise().norm();
  const double quantile = student_quantile(problem.confidence, freedom);
  for (Eigen::Index i = 0; i < count; ++i) {
    if (open[i] > 1e-6) continue;
    report.interval[i] = quantile * std::sqrt(covariance(i, i));
    for (Eigen::Index j = 0; j < count; ++j)
      if (open[j] <= 1e-6) report.covariance(i, j) = covariance(i, j);
  }
}

}  // namespace

double student_quantile(double probability, double degrees) {
  if (!(probability > 0.0 && probability < 1.0 && degrees > 0.0)) return nan;
  const double log_factor = std::lgamma(0.5 * (degrees + 1.0)) - std::lgamma(0.5 * degrees) -
                            0.5 * std::log(degrees * std::numbers::pi);
  // With t = √ν tan φ the integrand is cos(φ)^(ν−1), smooth up to the end: Simpson's rule.
  const auto inside = [&](double phi) {
    constexpr int parts = 2000;
    double sum = 1.0 + std::pow(std::cos(phi), degrees - 1.0);
    for (int i = 1; i < parts; ++i)
      sum += (i % 2 == 1 ? 4.0 : 2.0) * std::pow(std::cos(phi * i / parts), degrees - 1.0);
    return 2.0 * std::exp(log_factor) * std::sqrt(degrees) * sum * phi / (3.0 * parts);
  };
  double low = 0.0, high = 0.5 * std::numbers::pi;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (inside(middle) < probability ? low : high) = middle;
  }
  return std::sqrt(degrees) * std::tan(0.5 * (low + high));
}

FitReport fit(const FitProblem& problem, const FitData& data, const Vector& parameters) {
  require_data(data);
  if (!problem.outputs &&
      std::ranges::any_of(data.columns, [](const auto& column) { return column.output >= 0; }))
    throw Misuse("fit: a column of an output, and no outputs");
  Residuals residuals(problem, data);
  if (parameters.size() == 0) throw Misuse("fit: no parameters");
  if (residuals.values() < parameters.size())
    throw Misuse("fit: " + std::to_string(residuals.values()) + " measured numbers for " +
                 std::to_string(parameters.size()) + " parameters");
  require_times(data, problem.scene(parameters).scene->start.time, problem.steps.step);
  if (const std::string failure = residuals.at(parameters).failure;
      !failure.empty() && failure != interrupted_fit)
    throw Misuse("fit: the motion where the search begins: " + failure);
  FitReport report;
  report.parameters = parameters;
  report.measured = residuals.values();
  Eigen::LevenbergMarquardt<Residuals> search(residuals);
  search.parameters.maxfev = problem.max_evaluations;
  search.parameters.ftol = search.parameters.xtol = 1e-13;
  const auto status = search.minimize(report.parameters);
  report.ending = words(status);
  report.converged = status > 0 && status != Eigen::LevenbergMarquardtSpace::TooManyFunctionEvaluation &&
                     status != Eigen::LevenbergMarquardtSpace::UserAsked;
  measure_uncertainty(problem, residuals, report);
  report.evaluations = residuals.evaluations();
  report.residuals = Columns::Constant(data.values.rows(), data.values.cols(), nan);
  const FittedMotion& end = residuals.at(report.parameters);
  if (end.failure.empty())
    for (Eigen::Index c = 0; c < data.values.cols(); ++c)
      report.residuals.col(c) =
          (data.values.col(c) - end.values.col(c)) / data.columns[static_cast<std::size_t>(c)].sigma;
  return report;
}

}  // namespace diracstep
