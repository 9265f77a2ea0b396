/* The order of the three kinds. */
#include "core/standpoint.h"

#include <stdlib.h>

#include "core/standpoint/survey.h"

static int find(struct survey *s, const struct sh_report *report, struct standpoint *out, struct sh_err *err)
{
    struct survey_best best = {0};
    int rc = survey_floors(s, report, &best, err);
    if (rc != SH_OK) return rc;
    if (best.inside_score > 0.0)
        *out = best.inside;
    else if (best.ground_score > 0.0)
        *out = best.ground;
    else
        survey_outside(s, out);
    out->faces_out = out->kind != STANDPOINT_INSIDE && best.faces_out;
    return SH_OK;
}

int standpoint_find(const struct scene *scene, const struct standpoint_view *view, const struct sh_report *report,
                    struct standpoint *out, struct sh_err *err)
{
    *out = (struct standpoint){0};
    if (!(view->range_min_m < view->range_max_m) || !(view->line_min_rad < view->line_max_rad))
        return sh_fail(err, SH_EINPUT, "standpoint: a view of %g to %g m, %g to %g rad; allowed is one with some room",
                       view->range_min_m, view->range_max_m, view->line_min_rad, view->line_max_rad);
    struct survey *s = malloc(sizeof *s);
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "no memory for a survey of the scene");
    int rc = survey_open(s, scene, view, report, err);
    if (rc == SH_OK) rc = find(s, report, out, err);
    survey_close(s);
    free(s);
    return rc;
}
