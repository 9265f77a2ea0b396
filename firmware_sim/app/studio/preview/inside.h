/* SPDX-License-Identifier: MIT */
/* Private to this folder: requests, and the work that answers them. README.md lists the files. */
#ifndef FIRMWARE_SIM_APP_STUDIO_PREVIEW_INSIDE_H
#define FIRMWARE_SIM_APP_STUDIO_PREVIEW_INSIDE_H

#include "firmware_sim/app/sites.h"
#include "firmware_sim/app/studio/preview/preview.h"
#include "firmware_sim/config/config.h"

enum { PREVIEW_MOST_PULSES = 1500000, PREVIEW_MOST_OF = 16, PREVIEW_MOST_PIECES = 400000 };

enum preview_kind { PREVIEW_PLACE, PREVIEW_NEXT, PREVIEW_REACH, PREVIEW_CELLS };

/* A box that is turned about the vertical by heading_deg, clockwise from above. half_m: half of the box's size to the
 * right, ahead and up. */
struct preview_section {
    double middle_m[3], half_m[3], heading_deg; /* half_m INFINITY: no limit in that direction */
};

/* far_m, line_deg and pan_deg: INFINITY stands for the scanner's value at power-up. */
struct preview_request {
    enum preview_kind kind;
    uint32_t station; /* from 0; the scan has its scanner and its tripod */
    struct site_place place;
    double step_deg, far_m, line_deg[2], pan_deg[2];
    int points; /* 0: only the cells are wanted */
    /* of PREVIEW_NEXT and PREVIEW_REACH */
    uint32_t n_named, named[PREVIEW_MOST_OF]; /* numbers of previews, whose cells count as seen */
    double height_m;                          /* of the head above the floor */
    struct preview_section section;           /* of PREVIEW_NEXT: only cells with their middles in it count */
};

/* Returns SH_EINPUT with an empty text where nothing is at that path. */
int preview_read_request(const struct preview_options *options, const char *path, const char *query,
                         struct preview_request *out, struct sh_err *err);

/* The cells and hits of a preview that was answered. */
struct preview_seen {
    uint64_t *cells; /* [preview_words] */
    uint64_t hits, front;
};

/* The preview's own thread alone uses this. */
struct preview_work {
    const struct preview_options *options;
    struct coverage *coverage; /* that of the options; if they have no coverage, one without cells */
    const struct sites *sites; /* a scanner that could not be set up has no site */
    struct sh_report stop;     /* long work asks this report whether it must stop */
};
static inline size_t preview_words(const struct coverage *coverage)
{
    return ((size_t)coverage_cells(coverage) + 63) / 64;
}

/* A copy of a scanner's site, with the settings of a request and room for a place of its own. The copy shares all else
 * with the original. The struct is large. free() releases it, after a failure, too: *out may then be NULL or not. */
struct preview_site {
    struct site site;
    struct config cfg;
};
int preview_site_open(const struct preview_work *work, const struct preview_request *request, struct preview_site **out,
                      struct sh_err *err);

/* These four functions make bodies, whose formats README.md has. number: the preview's. */
int preview_look(const struct preview_work *work, const struct preview_request *request, uint32_t number,
                 struct web_body *out, struct sh_err *err);
/* Offsets in the body of preview_look: searches read cells and hits from there. */
enum { PREVIEW_HEAD_BYTES = 72, PREVIEW_CELLS_AT = 72, PREVIEW_HITS_AT = 24, PREVIEW_FRONT_AT = 28 };
/* seen has request->n_named previews. */
int preview_next(const struct preview_work *work, const struct preview_request *request,
                 const struct preview_seen *seen, struct web_body *out, struct sh_err *err);
int preview_reach(const struct preview_work *work, const struct preview_request *request,
                  const struct preview_seen *seen, struct web_body *out, struct sh_err *err);
int preview_cells(const struct preview_work *work, struct web_body *out, struct sh_err *err);

#endif
