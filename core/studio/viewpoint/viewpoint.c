/* SPDX-License-Identifier: MIT */
/* The three kinds of viewpoints are tried in their order. */
#include "core/studio/viewpoint.h"

#include <stdlib.h>

#include "core/angle.h"
#include "core/studio/viewpoint/survey.h"

/* From outside, a wide and sparse scene shows next to nothing. Then the survey takes a part of it. */
static int look_from_outside(struct survey *s, struct viewpoint *out, struct sh_err *err)
{
    const double least_seen = 0.02;
    struct viewpoint part = {0};
    const int is_found = survey_outside(s, out);
    if (out->seen >= least_seen) return SH_OK;
    const int rc = survey_narrow(s, err);
    if (rc != SH_OK) return rc;
    const int is_part_found = survey_outside(s, &part);
    if (part.seen > out->seen || (is_part_found && !is_found)) *out = part;
    if (is_found || is_part_found) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "viewpoint: a view of %.4g to %.4g deg holds nothing of the scene from any place that was tried",
                   angle_deg(s->view->line_min_rad), angle_deg(s->view->line_max_rad));
}

static int viewpoint_find_one(struct survey *s, const struct sh_report *report, struct viewpoint *out,
                              struct sh_err *err)
{
    struct survey_best best = {0};
    int rc = survey_floors(s, report, &best, err);
    if (rc != SH_OK) return rc;
    if (best.inside_score > 0.0)
        *out = best.inside;
    else if (best.ground_score > 0.0)
        *out = best.ground;
    else
        rc = look_from_outside(s, out, err);
    out->faces_out = out->kind != VIEWPOINT_INSIDE && best.faces_out;
    return rc;
}

int viewpoint_find(const struct scene *scene, const struct viewpoint_view *view, const struct sh_report *report,
                   struct viewpoint *out, struct sh_err *err)
{
    *out = (struct viewpoint){0};
    if (!(view->range_min_m < view->range_max_m) || !(view->line_min_rad < view->line_max_rad))
        return sh_fail(err, SH_EINPUT,
                       "viewpoint: a view of %g to %g m, %g to %g rad; each second limit must be above the first",
                       view->range_min_m, view->range_max_m, view->line_min_rad, view->line_max_rad);
    struct survey *s = malloc(sizeof *s);
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a survey of the scene");
    int rc = survey_open(s, scene, view, report, err);
    if (rc == SH_OK) rc = viewpoint_find_one(s, report, out, err);
    survey_close(s);
    free(s);
    return rc;
}
