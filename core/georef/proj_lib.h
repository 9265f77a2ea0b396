/* SPDX-License-Identifier: MIT */
/* PROJ, loaded once somebody asks for a grid. Its libraries, curl and all that curl needs, take longer to load than all
 * others of the head together, and few scenes lie in a grid.
 *
 * A call of PROJ is lib.proj_create(...), with the types of proj.h. Any thread; the library stays until the process ends. */
#ifndef CORE_GEOREF_PROJ_LIB_H
#define CORE_GEOREF_PROJ_LIB_H

#include <proj.h>

#include "core/err.h"

/* This project calls these. */
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

struct proj_lib {
#define PROJ_MEMBER(call) __typeof__(call) *call;
    PROJ_CALLS(PROJ_MEMBER)
#undef PROJ_MEMBER
};

/* SH_EINPUT: it is not on this machine, or another version. */
int proj_lib_load(struct proj_lib *lib, struct sh_err *err);

#endif
