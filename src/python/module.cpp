// The extension module sonic_bullet._engine: dtypes, numbers and functions of each stage.
#define ENGINE_IMPORTS_NUMPY
#include "../vector_level.hpp"
#include "arrays.hpp"

namespace engine {
void bind_math(nb::module_& m);
void bind_geometry(nb::module_& m);
void bind_contact(nb::module_& m);
void bind_bank(nb::module_& m);
void bind_coupling(nb::module_& m);
void bind_path(nb::module_& m);
void bind_runtime(nb::module_& m);
void bind_listener(nb::module_& m);
void bind_modal(nb::module_& m);
void bind_radiation(nb::module_& m);
void bind_residual(nb::module_& m);
void bind_effects(nb::module_& m);
void bind_signal(nb::module_& m);
}  // namespace engine

static int import_numpy() {
    import_array1(-1);
    return 0;
}

NB_MODULE(_engine, m) {
    if (import_numpy() < 0) nanobind::raise_python_error();
    m.def(
        "vector_level", [] { return static_cast<int>(engine::vector_level()); },
        "Return the level of vector instructions in use: 0 baseline, 1 AVX2, 2 AVX-512.");
    m.def(
        "force_vector_level",
        [](int level) {
            engine::check_range("level", level, 0, static_cast<int64_t>(engine::best_vector_level()) + 1);
            engine::force_vector_level(static_cast<engine::VectorLevel>(level));
        },
        nanobind::arg("level"), "Use other vector instructions than the best; the bits are the same. For tests.");
    engine::bind_math(m);
    engine::bind_geometry(m);
    engine::bind_contact(m);
    engine::bind_bank(m);
    engine::bind_coupling(m);
    engine::bind_path(m);
    engine::bind_runtime(m);
    engine::bind_listener(m);
    engine::bind_modal(m);
    engine::bind_radiation(m);
    engine::bind_residual(m);
    engine::bind_effects(m);
    engine::bind_signal(m);
}
