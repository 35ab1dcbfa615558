// SPDX-License-Identifier: Apache-2.0
#include "arrays.hpp"

#include <cstring>

namespace locus_python {
namespace {

/// Returns the first `columns` numbers of each surface.
py::array_t<float> table_of(const std::vector<liblocus::Surface>& surfaces, std::size_t columns) {
  static_assert(sizeof(liblocus::Surface) == 6 * sizeof(float));
  py::array_t<float> table({surfaces.size(), columns});
  for (std::size_t i = 0; i < surfaces.size(); ++i)
    std::memcpy(table.mutable_data() + i * columns, &surfaces[i], columns * sizeof(float));
  return table;
}

} // namespace

py::array_t<double> vector_of(std::span<const double> values) {
  return py::array_t<double>(static_cast<py::ssize_t>(values.size()), values.data());
}

py::array_t<double> matrix_of(std::span<const double> values) {
  constexpr py::ssize_t kSide = 6;
  return py::array_t<double>({kSide, kSide}, values.data());
}

py::array_t<float> points_of(const std::vector<liblocus::Surface>& surfaces) { return table_of(surfaces, 3); }
py::array_t<float> surfaces_of(const std::vector<liblocus::Surface>& surfaces) { return table_of(surfaces, 6); }

Bytes::Bytes(const py::buffer& object) {
  if (PyObject_GetBuffer(object.ptr(), &view_, PyBUF_SIMPLE) != 0)
    throw py::error_already_set();
}

} // namespace locus_python
