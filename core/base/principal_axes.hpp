// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace locus {

/// Symmetric 3x3 matrix, upper triangle.
template <class Real> struct Symmetric3 { Real xx, xy, xz, yy, yz, zz; };

/// Scatter of points about their mean: variances along the principal axes, and the axis of the least variance.
template <class Real> struct PrincipalAxes {
  Real least, middle, greatest;
  Real x, y,
      z; ///< unit axis of the least variance, or zero if all points coincide; its sign is arbitrary
};

/// Computes the eigenvalues of a positive semi-definite matrix and the eigenvector of the least.
///
/// Newton's method on the characteristic polynomial approaches the least root from zero without overshoot. If the least
/// variance is a tenth of the middle one, as for points on a plane, four steps leave an error of one millionth; if both
/// are equal they leave a tenth, still far from a plane. Has no branches and no trigonometric functions, so a loop over
/// many matrices is vectorised. Any thread.
template <class Real> [[gnu::always_inline]] inline PrincipalAxes<Real> principal_axes(const Symmetric3<Real>& m) {
  constexpr int kSteps = 4;
  constexpr Real kTiny = Real(1e-30); // avoids a division by zero
  const Real trace = m.xx + m.yy + m.zz;
  const Real minors = m.yy * m.zz - m.yz * m.yz + m.xx * m.zz - m.xz * m.xz + m.xx * m.yy - m.xy * m.xy;
  const Real determinant =
      m.xx * (m.yy * m.zz - m.yz * m.yz) - m.xy * (m.xy * m.zz - m.xz * m.yz) + m.xz * (m.xy * m.yz - m.xz * m.yy);
  const Real mean = trace / 3;
  Real least = 0;
  for (int step = 0; step < kSteps; ++step) {
    const Real value = ((trace - least) * least - minors) * least + determinant;
    const Real slope = (3 * least - 2 * trace) * least + minors;
    const Real next = least + (value > 0 ? value : Real(0)) / (slope > kTiny ? slope : kTiny);
    least = next < mean ? next : mean; // rounding dominates, e.g. for points on a line
  }
  const Real sum = trace - least;
  const Real discriminant = sum * sum - 4 * (minors - least * sum);
  const Real middle = Real(0.5) * (sum - std::sqrt(discriminant > 0 ? discriminant : Real(0)));

  // The axis is orthogonal to all columns of the remainder: the longest of their cross products is the most precise.
  const Real a = m.xx - least, b = m.yy - least, c = m.zz - least;
  const Real x1 = m.xy * m.yz - m.xz * b, y1 = m.xz * m.xy - a * m.yz, z1 = a * b - m.xy * m.xy;
  const Real x2 = b * c - m.yz * m.yz, y2 = m.yz * m.xz - m.xy * c, z2 = m.xy * m.yz - b * m.xz;
  const Real x3 = y2, y3 = c * a - m.xz * m.xz, z3 = m.xz * m.xy - m.yz * a;
  const Real n1 = x1 * x1 + y1 * y1 + z1 * z1, n2 = x2 * x2 + y2 * y2 + z2 * z2, n3 = x3 * x3 + y3 * y3 + z3 * z3;
  const bool second = n2 > n1;
  const Real n12 = second ? n2 : n1;
  const bool third = n3 > n12;
  const Real length2 = third ? n3 : n12;
  const Real scale = 1 / std::sqrt(length2 > kTiny ? length2 : kTiny);
  return {least,
          middle,
          sum - middle,
          scale * (third    ? x3
                   : second ? x2
                            : x1),
          scale * (third    ? y3
                   : second ? y2
                            : y1),
          scale * (third    ? z3
                   : second ? z2
                            : z1)};
}

} // namespace locus
