#pragma once

#include <algorithm>
#include <array>
#include <diracstep/core/steps/gauss_lobatto/stages_of_size.hpp>

/// The Jacobian of Stages and its splitting.
namespace diracstep::detail {

template <int n, int m, int s>
void Stages<n, m, s>::jacobian(bool same, double* values) {
  if (!same) take_block_of_lagrangian();
  const double* from = block_.data();
  for (int k = 0; k < velocities; ++k, from += velocities) copy<velocities>(from, values + unknowns * k);
  if constexpr (m > 0) {
    if (kernel_.run != nullptr) expand_impulses();
    if (s > 1) add_curvature(values);
    add_multipliers(values);
    add_constraint(values);
  }
}

template <int n, int m, int s>
void Stages<n, m, s>::take_splitting(const double* inverse_mass) {
  copy<n * n>(inverse_mass, inverse_mass_.data());
  if constexpr (m > 0) {
    if (kernel_.run != nullptr) expand_impulses();
    expand_constraint(constraint_forms_);
    for (int l = 0; l < s; ++l)
      for (int b = 0; b < m; ++b)
        for (int r = 0; r < n; ++r) {
          double sum = 0.0;
          for (int c = 0; c < n; ++c) sum += inverse_mass_[r + n * c] * lobatto_forms_[l][b + m * c];
          through_mass_[l][r + n * b] = sum;
        }
    std::array<double, s * m * s * m> response;
    for (int l = 0; l < s; ++l)
      for (int b = 0; b < m; ++b)
        for (int j = 0; j < s; ++j)
          for (int a = 0; a < m; ++a) {
            double sum = 0.0;
            for (int r = 0; r < n; ++r) sum += constraint_forms_[j][a + m * r] * through_mass_[l][r + n * b];
            response[(m * l + b) * s * m + m * j + a] = mix_[j * s + l] * sum;
          }
    response_.invert(response.data());
  }
}

template <int n, int m, int s>
void Stages<n, m, s>::solve_splitting(double* f) {
  std::array<double, velocities> v;
  if (diagonal_mass_) {
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) v[i * n + r] = inverse_mass_[r + n * r] * f[i * n + r];
  } else {
    for (int i = 0; i < s; ++i)
      for (int r = 0; r < n; ++r) {
        double sum = 0.0;
        for (int c = 0; c < n; ++c) sum += inverse_mass_[r + n * c] * f[i * n + c];
        v[i * n + r] = sum;
      }
  }
  if constexpr (m > 0) {
    double* const multipliers = f + velocities;
    constexpr std::array<double, velocities> zero{};
    std::array<double, velocities> mixed = v;
    if (holonomic_) sum_stages<n, s>(v.data(), by_constraint_.data(), zero.data(), n, mixed.data());
    for (int j = 0; j < s; ++j)
      for (int a = 0; a < m; ++a)
        for (int r = 0; r < n; ++r)
          multipliers[m * j + a] -= constraint_forms_[j][a + m * r] * mixed[n * j + r];
    response_.solve(multipliers);
    for (int l = 0; l < s; ++l)
      for (int r = 0; r < n; ++r) {
        double sum = 0.0;
        for (int b = 0; b < m; ++b) sum += through_mass_[l][r + n * b] * multipliers[m * l + b];
        mixed[n * l + r] = sum;
      }
    sum_stages<n, s>(mixed.data(), by_impulse_.data(), v.data(), n, v.data());
  }
  copy<velocities>(v.data(), f);
}

/// The part of L in the rows of the momentum.
template <int n, int m, int s>
void Stages<n, m, s>::take_block_of_lagrangian() {
  std::array<Square, s> qq, qv, vv;
  for (int i = 0; i < s; ++i) {
    second_.expand(a_.lqq + second_.entries() * i, qq[i].data());
    second_.expand(a_.lqv + second_.entries() * i, qv[i].data());
    second_.expand(a_.lvv + second_.entries() * i, vv[i].data());
  }
  for (int k = 0; k < s; ++k)
    for (int i = 0; i < s; ++i) {
      Square sum{};
      const double* const stiffness = &weights_.stiffness(0, i * s + k);
      for (int j = 0; j < s; ++j)
        for (int e = 0; e < n * n; ++e) sum[e] += stiffness[j] * qq[j][e];
      if (!separable_) {
        const double force = weights_.force(k, i), position = weights_.position(k, i);
        for (int c = 0; c < n; ++c)
          for (int r = 0; r < n; ++r)
            sum[r + n * c] += force * qv[k][r + n * c] + position * qv[i][c + n * r];
      }
      if (i == k)
        for (int e = 0; e < n * n; ++e) sum[e] += vv[i][e];
      for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r) entry(i, r, k, c) = sum[r + n * c];
    }
}

template <int n, int m, int s>
void Stages<n, m, s>::add_curvature(double* values) {
  std::array<Square, s> curvature;
  for (int j = 1; j < s; ++j)
    curvature_pattern_.expand(a_.curvature + curvature_pattern_.entries() * j, curvature[j].data());
  for (int k = 0; k < s; ++k)
    for (int i = 0; i < s; ++i) {
      Square sum{};
      const double* const weight = &weights_.row_curvature(0, i * s + k);
      for (int j = 1; j < s; ++j)
        for (int e = 0; e < n * n; ++e) sum[e] += weight[j] * curvature[j][e];
      for (int c = 0; c < n; ++c)
        for (int r = 0; r < n; ++r) values[(k * n + c) * unknowns + i * n + r] += sum[r + n * c];
    }
}

template <int n, int m, int s>
void Stages<n, m, s>::add_multipliers(double* values) {
  double* column = values + unknowns * velocities;
  for (int k = 0; k < s; ++k)
    for (int a = 0; a < m; ++a, column += unknowns) {
      for (int i = 0; i < s; ++i)
        for (int r = 0; r < n; ++r) column[i * n + r] = weights_.impulse(k, i) * lobatto_forms_[k][a + m * r];
      std::fill_n(column + velocities, s * m, 0.0);
    }
}

template <int n, int m, int s>
void Stages<n, m, s>::add_constraint(double* values) {
  expand_constraint(constraint_forms_now_);
  std::array<Forms, s> derivative{};
  if (!holonomic_)
    for (int j = 0; j < s; ++j)
      forms_pattern_.expand(a_.derivative + forms_pattern_.entries() * j, derivative[j].data());
  for (int k = 0; k < s; ++k)
    for (int r = 0; r < n; ++r) {
      double* const column = values + (k * n + r) * unknowns + velocities;
      for (int j = 0; j < s; ++j)
        for (int a = 0; a < m; ++a)
          column[m * j + a] = by_constraint_[j * s + k] * constraint_forms_now_[j][a + m * r] +
                              (holonomic_ ? 0.0 : weights_.position(k, j) * derivative[j][a + m * r]);
    }
}

}  // namespace diracstep::detail
