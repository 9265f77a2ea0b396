#include "firmware_sim/site/site_inside.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/angle.h"

/* The last stop may lie after the end by a rounding error: 1e-9 of a step, for times as people write them. */
static int count_stops(const struct site *site, const struct site_part *part, uint32_t *n, struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    double length_s = part->end_s - part->start_s, steps = floor(length_s / p->step_s + 1e-9);
    if (steps + 1.0 > CONFIG_MAX_STOPS)
        return sh_fail(err, SH_EINPUT, "%s: platform.step_s: %.0f stops in %.9g s; allowed at most %d, steps of %.9g s",
                       site->cfg->file, steps + 1.0, length_s, CONFIG_MAX_STOPS, length_s / (CONFIG_MAX_STOPS - 1));
    *n = (uint32_t)steps + 1;
    if (site->cfg->head.settings.station > *n)
        return sh_fail(err, SH_EINPUT, "%s: head.station: there is no stop %u; allowed 1 to %u", site->cfg->file,
                       site->cfg->head.settings.station, *n);
    return SH_OK;
}

/* The only station's place on the Earth as an anchor of the scene. */
static int anchor_scene(struct site *site, struct sh_err *err)
{
    const struct placement *at = &site->station[0].at;
    if (site->anchor.known || !at->on_earth) return SH_OK;
    site->anchor.known = 1;
    return geoframe_set_tangent(&site->anchor.frame, at->position_m, &at->place, 0.0, err);
}

static int place(const struct site *site, const struct pose *head, struct placement *at, struct sh_err *err)
{
    memcpy(at->position_m, head->position_m, sizeof at->position_m);
    pose_matrix(head->quat, at->rotation);
    at->floor_m = NAN;
    at->on_earth = site->anchor.known;
    return at->on_earth ? geoframe_locate(&site->anchor.frame, at->position_m, &at->place, err) : SH_OK;
}

/* As a station of the configuration would say it. */
static void describe(const struct pose *head, uint32_t i, struct config_station *out)
{
    double heading, pitch, roll;
    pose_to_angles(head->quat, &heading, &pitch, &roll);
    snprintf(out->name, sizeof out->name, "stop-%u", i + 1);
    memcpy(out->position_m, head->position_m, sizeof out->position_m);
    out->has_position = 1;
    out->heading_deg = angle_deg(heading);
    out->pitch_deg = angle_deg(pitch);
    out->roll_deg = angle_deg(roll);
}

static int add_stop(struct site *site, const struct site_part *part, const struct pose *mount, uint32_t i,
                    struct sh_err *err)
{
    const struct config_platform *p = &site->cfg->platform;
    struct site_station *s = &site->station[i];
    struct pose body, head;
    struct sh_err why;
    double since_s = i * p->step_s;
    trajectory_at(part->trajectory, fmin(part->start_s + since_s, part->end_s), &body, &s->frame);
    pose_mount(&body, mount, &head);
    s->t_s = p->start_s + since_s;
    s->station = &site->stop[i];
    describe(&head, i, &site->stop[i]);
    int rc = place(site, &head, &s->at, &why);
    return rc == SH_OK ? rc : sh_fail(err, rc, "%s: stop %u: %.300s", site->cfg->file, i + 1, why.text);
}

int site_load_stops(struct site *site, struct sh_err *err)
{
    struct site_part part;
    struct pose mount;
    uint32_t n = 0;
    int rc = site_open_trajectory(site, &part, err);
    if (rc != SH_OK) return rc;
    rc = count_stops(site, &part, &n, err);
    if (rc == SH_OK) rc = anchor_scene(site, err);
    if (rc == SH_OK) {
        free(site->station);
        site->station = calloc(n, sizeof *site->station);
        site->stop = calloc(n, sizeof *site->stop);
        site->n_stations = site->station != NULL ? n : 0;
        if (site->station == NULL || site->stop == NULL) rc = sh_fail(err, SH_ENOMEM, "no memory for %u stops", n);
    }
    site_get_mount(&site->cfg->platform, &mount);
    for (uint32_t i = 0; i < n && rc == SH_OK; i++)
        rc = add_stop(site, &part, &mount, i, err);
    trajectory_free(part.trajectory);
    return rc;
}
