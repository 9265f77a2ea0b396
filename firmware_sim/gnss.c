#include "firmware_sim/gnss.h"

#include <math.h>
#include <string.h>

#include "core/rng.h"
#include "drivers/protocol/nmea.h"

void gnss_init(struct gnss *gnss, const struct site *site, const struct head_clock *clock)
{
    const struct config *cfg = site->cfg;
    *gnss = (struct gnss){.site = site, .clock = clock};
    for (uint32_t i = 0; i < cfg->n_links; i++)
        if (cfg->link[i].protocol == PROTOCOL_NMEA) gnss->on = 1;
    if (gnss->on) gnss->period_ns = UTC_SECOND_NS / cfg->gnss.rate_hz;
}

/* Number of the first position at or after a time since 1970; TAI's full seconds are UTC's. */
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
    double lat_deg, lon_deg, height_m; /* of the antenna */
    double velocity_m_s[3];            /* east, north, up */
};

/* The antenna at a device time, with the head's origin at a station, and shift_m east, north and up from there. The one
 * place that knows how the head moves: it stands. */
static void gnss_position(const struct gnss *gnss, uint32_t station, int64_t t_ns, const double shift_m[3],
                          struct gnss_place *out)
{
    (void)t_ns;
    const struct site_station *s = &gnss->site->station[station];
    const double *arm_m = gnss->site->cfg->gnss.lever_arm_m, *r = s->rotation;
    double d_m[3], geodetic[3];
    for (int i = 0; i < 3; i++)
        d_m[i] = r[3 * i] * arm_m[0] + r[3 * i + 1] * arm_m[1] + r[3 * i + 2] * arm_m[2] + shift_m[i];
    georef_geodetic(s->station->lat_deg, s->station->lon_deg, s->station->height_m, d_m, geodetic);
    *out = (struct gnss_place){.lat_deg = geodetic[0], .lon_deg = geodetic[1], .height_m = geodetic[2]};
}

static void fill_place(const struct gnss *gnss, const struct gnss_place *place, struct nmea_fix *fix)
{
    const double *v = place->velocity_m_s;
    fix->lat_deg = place->lat_deg;
    fix->lon_deg = place->lon_deg;
    fix->geoid_separation_m = gnss->site->cfg->gnss.geoid_separation_m;
    fix->altitude_m = place->height_m - fix->geoid_separation_m;
    fix->speed_m_s = hypot(v[0], v[1]);
    fix->course_deg = fix->speed_m_s > 0.0 ? fmod(atan2(v[0], v[1]) * 180.0 / M_PI + 360.0, 360.0) : NAN;
}

static void fill_time(const struct gnss *gnss, int64_t t_ns, struct nmea_fix *fix)
{
    struct utc_time utc;
    utc_from_tai(&gnss->clock->table, head_clock_true_ns(gnss->clock, t_ns), &utc);
    fix->year = utc.year;
    fix->month = utc.month;
    fix->day = utc.day;
    fix->hour = utc.hour;
    fix->minute = utc.minute;
    fix->second = utc.second;
    fix->hundredth = utc.ns / 10000000;
}

size_t gnss_sentences(const struct gnss *gnss, uint64_t index, uint32_t station, char *dst, size_t cap)
{
    const struct config_gnss *c = &gnss->site->cfg->gnss;
    int64_t t_ns = gnss_time_ns(gnss, index);
    double noise_m[3] = {0.0, 0.0, 0.0};
    uint64_t key = rng_key(gnss->site->cfg->seed, RNG_GNSS);
    for (uint64_t i = 0; i < 3 && c->accuracy_m > 0.0; i++)
        noise_m[i] = c->accuracy_m * rng_normal(key, 3 * index + i);
    struct gnss_place place;
    gnss_position(gnss, station, t_ns, noise_m, &place);
    struct nmea_fix fix = {.talker = {'G', c->talker == TALKER_GP ? 'P' : 'N'},
                           .quality = (int)c->quality,
                           .satellites = (int)c->satellites,
                           .hdop = c->hdop,
                           .sigma_m = {c->accuracy_m, c->accuracy_m, c->accuracy_m}};
    fill_time(gnss, t_ns, &fix);
    fill_place(gnss, &place, &fix);
    return nmea_encode_all(dst, cap, &fix);
}
