// SPDX-License-Identifier: Apache-2.0
// Principal axes of the covariance of the position.

/** Returns the block of the axes `wanted` of the row-major 6 x 6 covariance. */
export const block = (covariance, wanted) => wanted.map((row) => wanted.map((column) => covariance[6 * row + column]));

/** Returns the standard deviations along the principal axes and these axes, or null without a covariance. */
export function deviations(covariance, wanted = [0, 1, 2]) {
  if (!covariance?.every(Number.isFinite)) return null;
  const matrix = block(covariance, wanted), size = wanted.length;
  const axes = wanted.map((_, i) => wanted.map((_, k) => (i === k ? 1 : 0)));
  const kRotations = 30;  // of Jacobi's method; three axes converge in fewer
  for (let n = 0; n < kRotations; ++n) {
    const [p, q] = largestOffDiagonal(matrix);
    if (matrix[p][q] === 0) break;
    const angle = 0.5 * Math.atan2(2 * matrix[p][q], matrix[q][q] - matrix[p][p]);
    const c = Math.cos(angle), s = Math.sin(angle);
    for (let k = 0; k < size; ++k)
      [matrix[k][p], matrix[k][q]] = [c * matrix[k][p] - s * matrix[k][q], s * matrix[k][p] + c * matrix[k][q]];
    for (const rows of [matrix, axes])
      for (let k = 0; k < size; ++k)
        [rows[p][k], rows[q][k]] = [c * rows[p][k] - s * rows[q][k], s * rows[p][k] + c * rows[q][k]];
  }
  return {sd_m: matrix.map((row, i) => Math.sqrt(Math.max(row[i], 0))), axes};
}

function largestOffDiagonal(matrix) {
  let largest = [0, 1];
  for (let p = 0; p < matrix.length; ++p)
    for (let q = p + 1; q < matrix.length; ++q)
      if (Math.abs(matrix[p][q]) > Math.abs(matrix[largest[0]][largest[1]])) largest = [p, q];
  return largest;
}
