// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <type_traits>

#include <Eigen/Core>

#include "core/base/pose.hpp"
#include "core/odometry/learned_source.hpp"

namespace locus {

/// Part of the state vector: N states from `begin` on.
template <int N> struct Block { int begin = 0; };

/// Returns a part of a vector, or of a matrix over the state vector.
template <class Vector, int N> auto part(Vector& vector, Block<N> block) {
  return vector.template segment<N>(block.begin);
}
template <class Matrix, int R, int C> auto part(Matrix& matrix, Block<R> rows, Block<C> columns) {
  return matrix.template block<R, C>(rows.begin, columns.begin);
}

/// Covariance of all states of the motion filter, and the only place that changes it. Common states come first, those
/// of the sources after them. Fixed capacity, never allocates.
class JointCovariance {
  template <class T> using Like = std::type_identity_t<T>; ///< a T, or an expression that converts to it

 public:
  static constexpr int kCommonStates = 27;
  static constexpr int kMaxStates = kCommonStates + (LearnedSource::kMostStates + 1) * static_cast<int>(kMaxSources);
  using State = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxStates, 1>;
  using Common = Eigen::Matrix<double, kCommonStates, kCommonStates>;
  using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxStates, kMaxStates>;

  [[nodiscard]] const Matrix& matrix() const { return P_; }
  [[nodiscard]] double variance(int state) const { return P_(state, state); }
  template <int R, int C> [[nodiscard]] auto block(Block<R> rows, Block<C> columns) const {
    return part(P_, rows, columns);
  }
  template <int N> [[nodiscard]] auto variances(Block<N> block) const {
    return P_.diagonal().template segment<N>(block.begin);
  }

  /// Sets the number of states; all become exact.
  void resize(int states) { P_ = Matrix::Zero(states, states); }
  /// Sets the covariance of the states from `begin` on; they become independent of all others.
  void reset(int begin, const Eigen::Ref<const Eigen::MatrixXd>& covariance);

  /// Adds noise to states.
  void add_variance(int state, double variance) { P_(state, state) += variance; }
  template <int N> void add_variance(Block<N> block, const Like<Eigen::Matrix<double, N, 1>>& variances) {
    P_.diagonal().template segment<N>(block.begin) += variances;
  }
  template <int N> void add_covariance(Block<N> block, const Like<Eigen::Matrix<double, N, N>>& covariance) {
    part(P_, block, block) += covariance;
  }

  /// Propagates by the Jacobian of the common states (P <- F P F'); those of the sources do not change.
  void propagate(const Common& F);
  /// Propagates by a Jacobian that adds `factors` times state `of` to a block.
  template <int N> void couple(Block<N> block, const Like<Eigen::Matrix<double, N, 1>>& factors, int of) {
    P_.template middleRows<N>(block.begin) += (factors * P_.row(of)).eval();
    P_.template middleCols<N>(block.begin) += (P_.col(of) * factors.transpose()).eval();
  }
  /// Propagates a state that reverts to its mean (Ornstein-Uhlenbeck process) with a stationary `variance`; `retained`
  /// is the factor by which its deviation decays.
  void revert(int state, double retained, double variance);

  /// Conditions on a scalar measurement: `Ph` is the covariance of the states with it. The considered part of Ph
  /// (Schmidt) stays as uncertain as it was.
  void condition(const State& Ph, const State& considered, double innovation_variance);
  /// Raises the variances of a block to these, at least.
  template <int N> void raise(Block<N> block, const Like<Eigen::Matrix<double, N, 1>>& least) {
    P_.diagonal().template segment<N>(block.begin) = variances(block).cwiseMax(least);
  }

 private:
  Matrix P_;
};

} // namespace locus
