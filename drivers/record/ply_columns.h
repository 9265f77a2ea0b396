/* The header of a PLY recording: facts and names of surfaces go in, text comes out. It stands at the
 * beginning of the file and is known at the end, so its size is reserved first. */
#ifndef DRIVERS_RECORD_PLY_COLUMNS_H
#define DRIVERS_RECORD_PLY_COLUMNS_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"

struct ply_facts {
    int ascii, empty_shots;
    uint64_t n_vertices, n_unplaced; /* points before their descriptor and anchor were seen */
    uint64_t n_without_pose;         /* points of a moving head whose pose was lost */
    uint64_t n_without_attributes;   /* echoes */
    int have_crs, crs, epsg, moving, stops, geoid_heights, attributes;
    int have_gps;
    double gps_s; /* GPS time of the first scan's start */
    char idn[96], profile[32];
    struct scanhead_stats stats;
};

struct ply_names {
    uint32_t n, n_named;
    struct ply_name {
        char *line; /* "comment label 3 object | material\n"; NULL: not seen */
    } * name;
};

/* At least n labels, so that room is left for their names. */
int ply_names_grow(struct ply_names *names, uint32_t n, struct sh_err *err);
int ply_names_set(struct ply_names *names, uint32_t label, const char *object, const char *material,
                  struct sh_err *err);
void ply_names_free(struct ply_names *names);

/* Bytes to leave for the header: all that is known now, and room for the names that are not. */
size_t ply_header_reserve(const struct ply_facts *facts, const struct ply_names *names);

/* The header, padded by comment lines to `size` bytes. *len is what it takes, which is more than size where
 * it does not fit, or would by less than the shortest line. Free *text. */
int ply_header_make(const struct ply_facts *facts, const struct ply_names *names, size_t size, char **text, size_t *len,
                    struct sh_err *err);

#endif
