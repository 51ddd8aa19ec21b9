#include "assignment.hpp"

#include <limits>
#include <utility>

namespace engine {

namespace {

constexpr double ENDLESS = std::numeric_limits<double>::infinity();

struct Path {
    int64_t end;  // the free column it ends at
    double cost;
};

// Find the shortest path from a row without a column to a column without a row; cost is a weight's negative.
Path shortest_path(Array<const double, 2> weight, int64_t row, AssignmentWork& work) {
    const int64_t columns = weight.shape[1];
    work.cost.assign(columns, ENDLESS);
    work.row_seen.assign(weight.shape[0], 0), work.column_seen.assign(columns, 0);
    work.open.resize(columns);
    for (int64_t k = 0; k < columns; ++k) work.open[k] = columns - 1 - k;  // equal weights give the identity
    double least = 0.0;
    for (int64_t opened = columns; opened > 0;) {
        work.row_seen[row] = 1;
        int64_t best = 0;
        double lowest = ENDLESS;
        for (int64_t k = 0; k < opened; ++k) {
            const int64_t j = work.open[k];
            const double cost = least - weight(row, j) - work.row_price[row] - work.column_price[j];
            if (cost < work.cost[j]) work.before[j] = row, work.cost[j] = cost;
            // of equal ones, a column that is free: the path ends there
            if (work.cost[j] < lowest || (work.cost[j] == lowest && work.row_of[j] < 0))
                lowest = work.cost[j], best = k;
        }
        least = lowest;
        const int64_t j = work.open[best];
        work.column_seen[j] = 1;
        work.open[best] = work.open[--opened];
        if (work.row_of[j] < 0) return {j, least};
        row = work.row_of[j];
    }
    return {-1, ENDLESS};
}

}  // namespace

void assign_columns(Array<const double, 2> weight, Array<int64_t, 1> column, AssignmentWork& work) {
    const int64_t rows = weight.shape[0], columns = weight.shape[1];
    work.row_price.assign(rows, 0.0), work.column_price.assign(columns, 0.0);
    work.before.assign(columns, -1), work.row_of.assign(columns, -1);
    for (int64_t i = 0; i < rows; ++i) column[i] = -1;
    for (int64_t first = 0; first < rows; ++first) {
        const Path path = shortest_path(weight, first, work);
        if (path.end < 0) return;
        work.row_price[first] += path.cost;
        for (int64_t i = 0; i < rows; ++i)
            if (work.row_seen[i] && i != first) work.row_price[i] += path.cost - work.cost[column[i]];
        for (int64_t j = 0; j < columns; ++j)
            if (work.column_seen[j]) work.column_price[j] -= path.cost - work.cost[j];
        for (int64_t j = path.end;;) {  // the path's rows change columns
            const int64_t row = work.before[j];
            work.row_of[j] = row;
            std::swap(column[row], j);
            if (row == first) break;
        }
    }
}

}  // namespace engine
