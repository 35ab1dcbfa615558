// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace locus::sim {

/// Value of a function of time with its first two derivatives. Arithmetic propagates the derivatives, so that a motion
/// is written once, as a position, and its velocity and acceleration are exact.
struct Jet {
  double value = 0, rate = 0, acceleration = 0;

  Jet() = default;
  Jet(double value_, double rate_ = 0, double acceleration_ = 0) // NOLINT(google-explicit-constructor): for constants
      : value(value_), rate(rate_), acceleration(acceleration_) {}

  friend Jet operator+(const Jet& a, const Jet& b) {
    return {a.value + b.value, a.rate + b.rate, a.acceleration + b.acceleration};
  }
  friend Jet operator-(const Jet& a, const Jet& b) {
    return {a.value - b.value, a.rate - b.rate, a.acceleration - b.acceleration};
  }
  friend Jet operator*(const Jet& a, const Jet& b) {
    return {a.value * b.value, a.rate * b.value + a.value * b.rate,
            a.acceleration * b.value + 2 * a.rate * b.rate + a.value * b.acceleration};
  }
};

/// Returns f(x) from the value and the first two derivatives of f at x.
inline Jet chain(double f, double slope, double curvature, const Jet& x) {
  return {f, slope * x.rate, curvature * x.rate * x.rate + slope * x.acceleration};
}

inline Jet sin(const Jet& x) {
  const double sine = std::sin(x.value);
  return chain(sine, std::cos(x.value), -sine, x);
}
inline Jet cos(const Jet& x) {
  const double cosine = std::cos(x.value);
  return chain(cosine, -std::sin(x.value), -cosine, x);
}
inline Jet atan(const Jet& x) {
  const double slope = 1 / (1 + x.value * x.value);
  return chain(std::atan(x.value), slope, -2 * x.value * slope * slope, x);
}
/// Returns x / (1 + x): from 0 at 0 towards 1.
inline Jet saturated(const Jet& x) {
  const double rest = 1 / (1 + x.value);
  return chain(x.value * rest, rest * rest, -2 * rest * rest * rest, x);
}

/// Quintic from 0 at u = 0 to 1 at u = 1, flat to the second order at both ends, with its derivatives and its integral
/// from 0.
inline double ease(double u) { return u * u * u * (10 + u * (-15 + 6 * u)); }
inline double ease_slope(double u) { return 30 * u * u * (1 - u) * (1 - u); }
inline double ease_curvature(double u) { return 60 * u * (1 - u) * (1 - 2 * u); }
inline double ease_integral(double u) { return u * u * u * u * (2.5 + u * (-3 + u)); }

/// Returns 0 up to -rounding / 2, then rises with x; the kink at 0 is rounded.
inline Jet rising(const Jet& x, double rounding) {
  const double u = x.value / rounding + 0.5;
  if (u <= 0)
    return {};
  return u < 1 ? chain(rounding * ease_integral(u), ease(u), ease_slope(u) / rounding, x) : x;
}

/// Rises linearly from 0 at x = 0 to 1 at x = length; the kinks are rounded.
inline Jet ramp(const Jet& x, double length, double rounding) {
  return (1 / length) * (rising(x, rounding) - rising(x - length, rounding));
}

/// Returns the quintic, 0 before and 1 after.
inline Jet ease(const Jet& u) {
  if (u.value <= 0 || u.value >= 1)
    return {u.value <= 0 ? 0.0 : 1.0};
  return chain(ease(u.value), ease_slope(u.value), ease_curvature(u.value), u);
}

} // namespace locus::sim
