// Linear assignment: to each row a column, each column once, with the largest sum of their weights.
//
// Shortest augmenting paths over rows, with dual prices u, v of rows and columns: [Jonker & Volgenant 1987, Computing
// 38, 325], as [Crouse 2016, IEEE Trans. Aerosp. Electron. Syst. 52, 1679] writes it. O(rows² columns).
#pragma once

#include <vector>

#include "../array.hpp"

namespace engine {

struct AssignmentWork {
    std::vector<double> row_price, column_price, cost;  // duals u, v; shortest path to each column
    std::vector<int64_t> before, row_of, open;  // row before a column on its path, row that has it; open columns
    std::vector<char> row_seen, column_seen;
};

// Fill column (m,) for weight (m, n), m <= n, all finite. Equal weights: the identity.
void assign_columns(Array<const double, 2> weight, Array<int64_t, 1> column, AssignmentWork& work);

}  // namespace engine
