#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <diracstep/core/numerics/contraction_loop.hpp>
#include <diracstep/core/numerics/scales.hpp>
#include <diracstep/core/numerics/small_inverse.hpp>
#include <diracstep/core/steps/gauss_lobatto/fixed_stages.hpp>
#include <diracstep/core/steps/gauss_lobatto/full_blocks.hpp>
#include <diracstep/core/steps/gauss_lobatto/stage_sums.hpp>
#include <diracstep/core/system/stage_kernel.hpp>
#include <functional>

namespace diracstep::detail {

/// FixedStages of n coordinates, m rows and s stages.
template <int n, int m, int s>
class Stages final : public FixedStages {
  static constexpr int rows = std::max(m, 1), unknowns = s * (n + m), velocities = s * n;
  using Square = std::array<double, n * n>;
  using Forms = std::array<double, rows * n>;  // m×n by columns

 public:
  explicit Stages(const StageArrays& arrays)
      : a_(arrays),
        weights_(arrays.points->weights),
        second_(arrays.lagrangian->pattern()),
        forms_pattern_(m > 0 ? arrays.rows->pattern() : SparsityPattern::dense(1, n)),
        curvature_pattern_(m > 0 ? arrays.rows->curvature_pattern() : SparsityPattern::dense(n, n)),
        separable_(arrays.lagrangian->structure().separable),
        diagonal_mass_(arrays.lagrangian->structure().y_hessian_diagonal),
        holonomic_(m > 0 && arrays.rows->holonomic()) {
    const GaussLobattoTableau& table = weights_.table;
    for (int j = 0; j < s; ++j)
      for (int k = 0; k < s; ++k) {
        by_constraint_[j * s + k] = holonomic_ ? table.lobatto_a(j + 1, k) : (j == k ? 1.0 : 0.0);
        by_impulse_[j * s + k] = table.e(j, k);
      }
    for (int j = 0; j < s; ++j)
      for (int l = 0; l < s; ++l)
        for (int k = 0; k < s; ++k) mix_[j * s + l] += by_constraint_[j * s + k] * by_impulse_[k * s + l];
    take_kernel();
  }

  double evaluate(const double* x) override {
    if (has_kernel()) {
      copy<unknowns>(x, evaluated_x_.data());
      run_kernel(evaluated_x_.data(), residual_.data());
      return call_.largest_impulse;
    }
    std::uint64_t largest = 0;
    StagePoints& at = *a_.points;
    const double* const q0 = at.lobatto.data();
    sum_stages<n, s>(x, weights_.position.data(), q0, 0, at.gauss.data());
    a_.lagrangian->gradients(at.at_gauss(x), a_.lq, a_.lv);
    if constexpr (m > 0) {
      sum_stages<n, s>(x, weights_.lobatto.data() + s, q0, 0, at.lobatto.data() + n);
      const int entries = forms_pattern_.entries();
      if (s > 1) a_.rows->coefficients_at(at.at_lobatto(1, s - 1), a_.at_lobatto + entries, a_.offset);
      for (int j = 0; j < s; ++j) {
        forms_pattern_.expand(a_.at_lobatto + entries * j, lobatto_forms_[j].data());
        impulse(lobatto_forms_[j], x + velocities + m * j, a_.impulses + n * j, largest);
      }
    }
    return std::bit_cast<double>(largest);
  }

  void residual(const double* x, double* f) override {
    if (kernel_.run != nullptr) return copy<unknowns>(residual_.data(), f);
    std::array<double, velocities> row;
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) row[i * n + r] = a_.lv[i * n + r] - a_.p0[r];
    sum_stages<n, s>(a_.lq, weights_.force.data(), row.data(), n, row.data());
    if constexpr (m > 0) sum_stages<n, s>(a_.impulses, weights_.impulse.data(), row.data(), n, row.data());
    copy<velocities>(row.data(), f);
    if constexpr (m > 0) constraint(x, f + velocities);
  }

  Contraction contract(double* x, double* f, const ContractionLimits& limits, Scales& scales,
                       const std::function<void()>& prepare) override {
    if (has_kernel()) return contract_in_kernel(x, f, limits, scales, prepare);
    std::array<double, 4> norms{};
    bool prepared = false;
    const auto evaluate = [&] {
      scales.moved = false;
      scales.momentum = std::max(scales.momentum, Stages::evaluate(x) + scales.beside_impulses);
      Stages::residual(x, f);
      norms[0] = largest_or_infinite(f, velocities);
      double largest = norms[0] / scales.momentum;
      if constexpr (m > 0) {
        norms[1] = largest_or_infinite(f + velocities, s * m);
        largest = std::max(largest, norms[1] / scales.constraint);
      }
      return largest;
    };
    const auto correct = [&] {
      if (!prepared) prepare();
      prepared = scales.moved = true;
      Stages::solve_splitting(f);
      for (int k = 0; k < unknowns; ++k) x[k] -= f[k];
    };
    Contraction end = diracstep::contract(limits, evaluate, correct);
    end.residual_norms = norms;
    return end;
  }

  void jacobian(bool same, double* values) override;
  void take_splitting(const double* inverse_mass) override;
  void solve_splitting(double* f) override;

 private:
  static constexpr long evaluations_told_at_once = 256;

  bool has_kernel() {
    if (kernel_.run == nullptr && ++evaluations_ == evaluations_told_at_once) take_kernel();
    return kernel_.run != nullptr;
  }
  void take_kernel() {
    const auto* const source = dynamic_cast<const StageKernelSource*>(a_.lagrangian);
    if (source != nullptr) kernel_ = source->stage_kernel(a_.rows, s, evaluations_);
    evaluations_ = 0;
    if (kernel_.run != nullptr) call_ = call_of_kernel();
  }

  /// Aᵀλ, and the bits of its largest term, which have the order of positive doubles.
  static void impulse(const Forms& forms, const double* lambda, double* to, std::uint64_t& largest) {
    for (int r = 0; r < n; ++r) {
      double sum = 0.0;
      for (int a = 0; a < m; ++a) {
        const double term = forms[a + m * r] * lambda[a];
        largest = std::max(largest, std::bit_cast<std::uint64_t>(term) & ~(std::uint64_t{1} << 63U));
        sum += term;
      }
      to[r] = sum;
    }
  }

  void constraint(const double* x, double* f) {
    const StagePoints& at = *a_.points;
    if (holonomic_) {
      a_.rows->positions(at.at_lobatto(1, s), f);
      const double per_step = 1.0 / at.step.size;
      for (int k = 0; k < s * m; ++k) f[k] *= per_step;
      return;
    }
    a_.rows->coefficients_at(at.at_gauss(), a_.at_gauss, f);
    for (int j = 0; j < s; ++j) {
      Forms& forms = constraint_forms_now_[j];
      forms_pattern_.expand(a_.at_gauss + forms_pattern_.entries() * j, forms.data());
      for (int a = 0; a < m; ++a)
        for (int r = 0; r < n; ++r) f[m * j + a] += forms[a + m * r] * x[n * j + r];
    }
  }

  /// What a kernel asks in the course of contract().
  struct Course {
    Stages& stages;
    ContractionSteps steps;
    Scales& scales;
    const std::function<void()>& prepare;
    bool prepared = false;

    int next() {
      const StageKernelCall& call = stages.call_;
      scales.moved = false;
      scales.momentum = std::max(scales.momentum, call.largest_impulse + scales.beside_impulses);
      double norm = call.momentum / scales.momentum;
      if (m > 0) norm = std::max(norm, call.constraint / scales.constraint);
      const ContractionSteps::Next next = steps.after(norm);
      if (next == ContractionSteps::Next::stop) return StageKernelCall::stop;
      if (!prepared) prepare();
      prepared = scales.moved = true;
      return next == ContractionSteps::Next::correct ? StageKernelCall::correct
                                                     : StageKernelCall::correct_and_stop;
    }
  };

  Contraction contract_in_kernel(double* x, double* f, const ContractionLimits& limits, Scales& scales,
                                 const std::function<void()>& prepare) {
    Course course{*this, ContractionSteps(limits), scales, prepare};
    call_.owner = &course;
    call_.next = [](void* owner) { return static_cast<Course*>(owner)->next(); };
    run_kernel(x, f);
    call_.next = nullptr;
    if (!scales.moved) copy<unknowns>(f, residual_.data());
    Contraction end = course.steps.end();
    end.residual_norms = {call_.momentum, call_.constraint};
    return end;
  }

  /// All of the residual at once, with its f in `f`, or the whole iteration.
  void run_kernel(double* x, double* f) {
    if (const double h = a_.points->step.size; h != weights_step_) {
      weights_step_ = h;
      call_.per_step = 1.0 / h;
      for (int i = 0; i < s; ++i)
        for (int k = 0; k < s; ++k) {
          stage_weights_[0][s * k + i] = weights_.position(k, i);
          stage_weights_[1][s * k + i] = weights_.lobatto(k, i + 1);
          stage_weights_[2][s * k + i] = weights_.force(k, i);
          stage_weights_[3][s * k + i] = weights_.impulse(k, i);
        }
    }
    call_.x = x;
    call_.f = f;
    kernel_.run(&call_);
  }

  /// Everything but x, f and the step.
  StageKernelCall call_of_kernel() {
    StagePoints& at = *a_.points;
    for (int i = 0; i < s; ++i)
      for (int k = 0; k < s; ++k) {
        stage_weights_[4][s * k + i] = by_constraint_[s * i + k];
        stage_weights_[5][s * k + i] = by_impulse_[s * i + k];
      }
    StageKernelCall call{};
    call.known = kernel_.known;
    call.q0 = at.lobatto.data(), call.p0 = a_.p0;
    call.position = stage_weights_[0].data(), call.lobatto = stage_weights_[1].data();
    call.force = stage_weights_[2].data(), call.impulse = stage_weights_[3].data();
    call.gauss = at.gauss.data(), call.lobatto_points = at.lobatto.data();
    call.lq = a_.lq, call.lv = a_.lv;
    call.at_lobatto = a_.at_lobatto, call.at_gauss = a_.at_gauss, call.impulses = a_.impulses;
    call.solve_rows = [](void* owner, double* multipliers) {
      static_cast<Course*>(owner)->stages.response_.solve(multipliers);
    };
    call.inverse_mass = inverse_mass_.data();
    call.constraint_forms = constraint_forms_.front().data();
    call.through_mass = through_mass_.front().data();
    call.by_constraint = stage_weights_[4].data(), call.by_impulse = stage_weights_[5].data();
    return call;
  }

  /// A where the impulses enter.
  void expand_impulses() {
    for (int j = 0; j < s; ++j)
      forms_pattern_.expand(a_.at_lobatto + forms_pattern_.entries() * j, lobatto_forms_[j].data());
  }

  /// A where the constraint stands.
  void expand_constraint(std::array<Forms, s>& forms) const {
    const double* const from = holonomic_ ? a_.at_lobatto + forms_pattern_.entries() : a_.at_gauss;
    for (int j = 0; j < s; ++j) forms_pattern_.expand(from + forms_pattern_.entries() * j, forms[j].data());
  }

  double& entry(int i, int r, int k, int c) { return block_[(k * n + c) * velocities + i * n + r]; }

  void take_block_of_lagrangian();
  void add_curvature(double* values);
  void add_multipliers(double* values);
  void add_constraint(double* values);

  StageArrays a_;
  StageKernel kernel_{};
  long evaluations_ = 0;  ///< without a kernel, and not told its source yet
  const StageWeights& weights_;
  FullBlocks<n, n> second_;
  FullBlocks<rows, n> forms_pattern_;
  FullBlocks<n, n> curvature_pattern_;
  bool separable_, diagonal_mass_, holonomic_;
  std::array<double, s * s> by_constraint_{}, by_impulse_{}, mix_{};  ///< C, e and C e, by rows
  std::array<Forms, s> lobatto_forms_{}, constraint_forms_now_{};     ///< at the last point
  std::array<Forms, s> constraint_forms_{};                           ///< of the splitting
  std::array<std::array<double, n * rows>, s> through_mass_{};        ///< M⁻¹ A(Q~_l)ᵀ
  Square inverse_mass_{};
  std::array<double, velocities * velocities> block_{};
  SmallInverse<s * m> response_;  ///< of the multipliers: (C e)_jl A_j M⁻¹ A(Q~_l)ᵀ
  std::array<std::array<double, s * s>, 6> stage_weights_{};  ///< of the kernel
  double weights_step_ = 0.0;                                 ///< the step size that they are for
  StageKernelCall call_{};
  std::array<double, unknowns> evaluated_x_{}, residual_{};  ///< of the kernel, at the last point
};

}  // namespace diracstep::detail
