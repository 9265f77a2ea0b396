/* SPDX-License-Identifier: MIT */
/* PROJ knows the grids that scenes lie in. It is loaded late (core/late.h), and brings curl and all that curl needs. */
#ifndef CORE_GEOREF_PROJ_LIB_H
#define CORE_GEOREF_PROJ_LIB_H

#include <proj.h>

#include "core/late.h"

#define PROJ_CALLS(CALL)                     \
    CALL(proj_context_create)                \
    CALL(proj_context_destroy)               \
    CALL(proj_context_set_enable_network)    \
    CALL(proj_log_level)                     \
    CALL(proj_create)                        \
    CALL(proj_destroy)                       \
    CALL(proj_get_type)                      \
    CALL(proj_crs_get_sub_crs)               \
    CALL(proj_crs_get_coordinate_system)     \
    CALL(proj_cs_get_axis_info)              \
    CALL(proj_get_area_of_use)               \
    CALL(proj_create_crs_to_crs)             \
    CALL(proj_normalize_for_visualization)   \
    CALL(proj_trans)                         \
    CALL(proj_trans_get_last_used_operation) \
    CALL(proj_pj_info)

LATE_LIBRARY(proj, PROJ_CALLS)

#endif
