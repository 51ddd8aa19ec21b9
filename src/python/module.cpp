// The extension module sonic_bullet._engine: dtypes, numbers and functions of each stage.
#define ENGINE_IMPORTS_NUMPY
#include <cstdlib>
#include <string>

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

// Use the vector instructions that SONIC_BULLET_VECTORS names, where it is set: baseline, avx2 or avx512.
static void choose_named_level() {
    const char* name = std::getenv("SONIC_BULLET_VECTORS");
    if (name == nullptr || *name == '\0') return;
    const char* const levels[] = {"baseline", "avx2", "avx512"};
    const int best = static_cast<int>(engine::best_vector_level());
    for (int level = 0; level <= best; ++level)
        if (std::string(name) == levels[level]) {
            engine::force_vector_level(static_cast<engine::VectorLevel>(level));
            return;
        }
    std::string known = levels[0];
    for (int level = 1; level <= best; ++level) known += std::string(", ") + levels[level];
    const std::string what = "SONIC_BULLET_VECTORS is '" + std::string(name) + "': this processor has " + known;
    throw nanobind::import_error(what.c_str());
}

NB_MODULE(_engine, m) {
    if (import_numpy() < 0) nanobind::raise_python_error();
    choose_named_level();
    m.def(
        "vector_level", [] { return static_cast<int>(engine::vector_level()); },
        "Return the level of vector instructions in use: 0 baseline, 1 AVX2, 2 AVX-512.");
    m.def(
        "best_vector_level", [] { return static_cast<int>(engine::best_vector_level()); },
        "Return the highest level of vector instructions that this processor has.");
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
