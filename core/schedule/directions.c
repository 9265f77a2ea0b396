/* SPDX-License-Identifier: MIT */
/* Lists of directions for a head that fires along them. */
#include <math.h>
#include <stdlib.h>

#include "core/angle.h"
#include "core/emitter.h"
#include "core/grow.h"
#include "core/text.h"

static const double TURN_DEG = 360.0;

struct list {
    struct emitter_firing *at;
    uint32_t n;
    size_t room;
    int columns; /* of the first row; 0: none yet */
};

/* Reads the numbers of the row at hand. Returns how many there are, or a negative error. */
static int read_numbers(struct text *t, double v[3], struct sh_err *err)
{
    int n = 0;
    for (text_skip_blanks(t); !text_at_line_end(t) && *t->p != '#'; text_skip_blanks(t)) {
        double value;
        if (n == 3 || !text_number(t, &value) || !isfinite(value))
            return text_fail(t, t->line, SH_EINPUT, err,
                             "not a direction; allowed are x y z, or azimuth and elevation in degrees");
        v[n++] = value;
    }
    return n;
}

static int add_row(const struct text *t, struct list *list, const double v[3], int n, struct sh_err *err)
{
    double azimuth_turn = v[0] / TURN_DEG, elevation_turn = v[1] / TURN_DEG;
    if (n < 2 || (list->columns != 0 && n != list->columns))
        return text_fail(t, t->line, SH_EINPUT, err, "a row with %d number%s; allowed %s in each row", n,
                         n == 1 ? "" : "s",
                         list->columns == 2   ? "2, azimuth and elevation in degrees,"
                         : list->columns == 3 ? "3, x y z,"
                                              : "3, x y z, or 2, azimuth and elevation in degrees,");
    if (n == 2 && !(fabs(v[1]) <= 90.0))
        return text_fail(t, t->line, SH_EINPUT, err, "an elevation of %.10g deg; allowed -90 to 90", v[1]);
    if (n == 2 && !(fabs(v[0]) <= TURN_DEG))
        return text_fail(t, t->line, SH_EINPUT, err, "an azimuth of %.10g deg; allowed -360 to 360", v[0]);
    if (n == 3 && !(v[0] != 0.0 || v[1] != 0.0 || v[2] != 0.0))
        return text_fail(t, t->line, SH_EINPUT, err, "0 0 0 is no direction; allowed any other x y z");
    if (n == 3) {
        azimuth_turn = angle_deg(atan2(v[0], v[1])) / TURN_DEG;
        elevation_turn = angle_deg(atan2(v[2], hypot(v[0], v[1]))) / TURN_DEG;
    }
    if (list->n == EMITTER_MAX_STEPS)
        return text_fail(t, t->line, SH_EINPUT, err, "too many directions; allowed up to %d", (int)EMITTER_MAX_STEPS);
    if (!grow(&list->at, &list->room, list->n + 1, sizeof *list->at))
        return sh_fail(err, SH_ENOMEM, "%s: no memory for %u directions", t->path, list->n + 1);
    list->columns = n;
    list->at[list->n] = (struct emitter_firing){list->n, elevation_turn, azimuth_turn};
    list->n++;
    return SH_OK;
}

static int read_rows(struct text *t, struct list *list, struct sh_err *err)
{
    int rc = SH_OK;
    for (; t->p < t->end && rc == SH_OK; text_next_line(t)) {
        double v[3] = {0};
        const int n = read_numbers(t, v, err);
        if (n != 0) rc = n < 0 ? n : add_row(t, list, v, n, err);
    }
    if (rc == SH_OK && list->n == 0)
        rc = text_fail(t, 0, SH_EINPUT, err, "no direction; allowed 1 to %d rows", (int)EMITTER_MAX_STEPS);
    return rc;
}

int emitter_read_directions(const char *path, struct emitter_firing **direction, uint32_t *n, struct sh_err *err)
{
    struct text text;
    struct list list = {0};
    *direction = NULL;
    int rc = text_open(&text, path, NULL, NULL, err);
    if (rc == SH_OK) rc = read_rows(&text, &list, err);
    text_close(&text);
    if (rc != SH_OK) {
        free(list.at);
        return rc;
    }
    *direction = list.at;
    *n = list.n;
    return SH_OK;
}
