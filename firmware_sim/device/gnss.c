/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/gnss.h"

#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/locate.h"
#include "core/mat3.h"
#include "core/rng.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/config/config.h"

void gnss_init(struct gnss *gnss, const struct site *site, const struct head_clock *clock)
{
    const struct config *cfg = site->cfg;
    *gnss = (struct gnss){.site = site, .clock = clock};
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].protocol != PROTOCOL_NATIVE && clock->source != EPOCH_NONE) gnss->on = 1;
    if (gnss->on) gnss->period_ns = UTC_SECOND_NS / cfg->gnss.rate_hz;
}

/* Returns the number of the first position at or after a time since 1970. A full second of TAI is one of UTC, too. */
static int64_t number_at(const struct gnss *gnss, int64_t tai_ns)
{
    return (tai_ns + gnss->period_ns - 1) / gnss->period_ns;
}

uint64_t gnss_count(const struct gnss *gnss, int64_t t_ns)
{
    if (!gnss->on) return 0;
    int64_t tai0_ns = head_clock_true_ns(gnss->clock, 0);
    return (uint64_t)(number_at(gnss, tai0_ns + t_ns) - number_at(gnss, tai0_ns));
}

int64_t gnss_time_ns(const struct gnss *gnss, uint64_t index)
{
    int64_t tai0_ns = head_clock_true_ns(gnss->clock, 0);
    return (number_at(gnss, tai0_ns) + (int64_t)index) * gnss->period_ns - tai0_ns;
}

struct gnss_place {
    double geodetic[3];     /* of the antenna: latitude, longitude (degrees), height (m) */
    double velocity_m_s[3]; /* east, north, up */
};

/* Finds the place on the Earth of a point of the scene. 0: there is none. */
static int locate(const struct site *site, const struct placement *at, const double p_prcs[3], double geodetic[3])
{
    struct georef_place place;
    double d_m[3];
    if (site->anchor.known) {
        if (geoframe_locate(&site->anchor.frame, p_prcs, &place, NULL) != SH_OK) return 0;
        geodetic[0] = place.lat_deg;
        geodetic[1] = place.lon_deg;
        geodetic[2] = place.height_m;
        return 1;
    }
    if (!at->on_earth) return 0;
    for (int i = 0; i < 3; i++)
        d_m[i] = p_prcs[i] - at->position_m[i];
    georef_geodetic(at->place.lat_deg, at->place.lon_deg, at->place.height_m, d_m, geodetic);
    return 1;
}

static int locate_antenna(const struct gnss *gnss, const struct placement *at, const struct pose *head,
                          double geodetic[3])
{
    double arm_m[3], p_prcs[3];
    pose_rotate(head->quat, gnss->site->cfg->gnss.lever_arm_m, arm_m);
    for (int i = 0; i < 3; i++)
        p_prcs[i] = head->position_m[i] + arm_m[i];
    return locate(gnss->site, at, p_prcs, geodetic);
}

/* Sets the velocity east, north and up, from two places that are span_ns apart. */
static void set_velocity(const double before[3], const double here[3], const double after[3], int64_t span_ns,
                         double velocity_m_s[3])
{
    const struct georef_place place[3] = {
        {before[0], before[1], before[2]}, {here[0], here[1], here[2]}, {after[0], after[1], after[2]}};
    double p[2][3], d[3], enu[9], at_ecef[3];
    georef_geodetic_to_ecef(&place[0], p[0]);
    georef_geodetic_to_ecef(&place[2], p[1]);
    for (int i = 0; i < 3; i++)
        d[i] = (p[1][i] - p[0][i]) / (1e-9 * (double)span_ns);
    if (locate_axes(&place[1], at_ecef, enu, NULL) == SH_OK) mat3_apply_transposed(enu, d, velocity_m_s);
}

/* Finds the antenna's place, with its error shift_m east, north and up. 0: it is nowhere on the Earth. */
static int gnss_position(const struct gnss *gnss, uint32_t station, const struct gnss_track *track,
                         const double shift_m[3], struct gnss_place *out)
{
    const struct placement *at = &gnss->site->station[station].at;
    struct pose stands;
    double here[3], before[3], after[3];
    memcpy(stands.position_m, at->position_m, sizeof stands.position_m);
    pose_from_matrix(at->rotation, stands.quat);
    if (!locate_antenna(gnss, at, track != NULL ? &track->at : &stands, here)) return 0;
    if (track != NULL && track->span_ns != 0 && locate_antenna(gnss, at, &track->before, before) &&
        locate_antenna(gnss, at, &track->after, after))
        set_velocity(before, here, after, track->span_ns, out->velocity_m_s);
    georef_geodetic(here[0], here[1], here[2], shift_m, out->geodetic);
    return 1;
}

static void fill_place(const struct gnss *gnss, const struct gnss_place *place, struct nmea_fix *fix)
{
    const double *v = place->velocity_m_s;
    fix->lat_deg = place->geodetic[0];
    fix->lon_deg = place->geodetic[1];
    fix->geoid_separation_m = gnss->site->cfg->gnss.geoid_separation_m;
    fix->altitude_m = place->geodetic[2] - fix->geoid_separation_m;
    fix->speed_m_s = hypot(v[0], v[1]);
    fix->course_deg = fix->speed_m_s > 0.0 ? fmod(angle_deg(atan2(v[0], v[1])) + 360.0, 360.0) : NAN;
}

void gnss_fix(const struct gnss *gnss, uint64_t index, uint32_t station, const struct gnss_track *track,
              struct nmea_fix *fix)
{
    const struct config_gnss *c = &gnss->site->cfg->gnss;
    double noise_m[3] = {0.0, 0.0, 0.0};
    uint64_t key = rng_key(gnss->site->cfg->noise.seed, RNG_GNSS);
    for (uint64_t i = 0; i < 3 && c->accuracy_m > 0.0; i++)
        noise_m[i] = c->accuracy_m * rng_normal(key, 3 * index + i);
    struct gnss_place place = {0};
    int found = gnss_position(gnss, station, track, noise_m, &place);
    struct utc_time utc;
    utc_from_tai(&gnss->clock->table, head_clock_true_ns(gnss->clock, gnss_time_ns(gnss, index)), &utc);
    *fix = (struct nmea_fix){.talker = {'G', c->talker == TALKER_GP ? 'P' : 'N'},
                             .year = utc.year,
                             .month = utc.month,
                             .day = utc.day,
                             .hour = utc.hour,
                             .minute = utc.minute,
                             .second = utc.second,
                             .hundredth = utc.ns / 10000000,
                             .quality = found ? (int)c->quality : 0,
                             .satellites = (int)c->satellites,
                             .hdop = c->hdop,
                             .sigma_m = {c->accuracy_m, c->accuracy_m, c->accuracy_m}};
    fill_place(gnss, &place, fix);
}
