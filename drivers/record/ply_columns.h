/* The header of a PLY recording: facts and names of surfaces go in, text comes out. It stands at the
 * beginning of the file and is known at the end, so its size is reserved first. */
#ifndef DRIVERS_RECORD_PLY_COLUMNS_H
#define DRIVERS_RECORD_PLY_COLUMNS_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/record/colour.h"
#include "drivers/record/track.h"

struct ply_facts {
    const struct track *track; /* its kind of points, and the handle that knows the surfaces' names */
    int ascii, empty_shots, scalar_names;
    enum colour_kind colour;
    uint64_t n_vertices, n_unplaced; /* points before their descriptor and anchor were seen */
    uint64_t n_without_pose;         /* points of a moving head whose pose was lost */
    uint64_t n_without_attributes;   /* echoes */
    int have_gps;
    double gps_s; /* GPS time of the first scan's start */
    char idn[96], profile[32];
    struct scanhead_stats stats;
};

/* Bytes to leave for the header: all that is known now, and room for those names of n_surfaces that are
 * not. */
size_t ply_header_reserve(const struct ply_facts *facts, uint32_t n_surfaces);

/* The header, padded by comment lines to `size` bytes. *len is what it takes, which is more than size where
 * it does not fit, or would by less than the shortest line. Free *text. */
int ply_header_make(const struct ply_facts *facts, size_t size, char **text, size_t *len, struct sh_err *err);

#endif
