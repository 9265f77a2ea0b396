/* SPDX-License-Identifier: MIT */
/* The limits of the configuration's numbers, from where they come: geometry, standards, the width of a field. All
 * others are 0 or a power of ten, so that a slip in the table shows. Each limit itself is allowed, and nothing beyond
 * it. */
#include "firmware_sim/config/keys.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/table/reader.h"
#include "firmware_sim/config/table/row.h"
#include "firmware_sim/config/table/value.h"
#include "tests/unit/config_rig.h"

#include <math.h>

static const double ANY = 18446744073709551615.0; /* 2^64 */

/* Rows with a dot name one key, the others all keys of that last word. */
static const struct limits {
    const char *word;
    double min, max;
} limits[] = {
    /* angles: a right angle, half a turn, a turn to either side */
    {"lat_deg", -90, 90},
    {"lon_deg", -180, 180},
    {"pitch_deg", -90, 90},
    {"mount_pitch_deg", -90, 90},
    {"elevation_deg", -90, 90},
    {"ring_start_deg", -90, 90},
    {"ring_stop_deg", -90, 90},
    {"roll_deg", -180, 180},
    {"faults[].deg", -180, 180},
    {"heading_deg", -360, 360},
    {"mount_heading_deg", -360, 360},
    {"legs_heading_deg", -360, 360},
    {"mount_roll_deg", -360, 360},
    {"north_deg", -360, 360},
    {"turn_deg", -360, 360},
    {"azimuth_deg", -360, 360},
    {"mirror_phase_deg", -360, 360},
    {"pan_phase_deg", -360, 360},
    {"pan_min_deg", -360, 360},
    {"pan_max_deg", -360, 360},
    {"phase_deg", 0, 359.999999},
    {"step_deg", 0.01, 90},
    {"opening_min_deg", 0, 89},
    {"fov_min_deg", -180, 360}, /* for a line head 90 is up, and larger angles are backward */
    {"fov_max_deg", -180, 360},
    {"angles_deg", -360, 720},
    {"turn_deg_s", -36000, 36000}, /* 100 turns a second */
    {"pan_max_deg_s", 0, 3600},    /* ten */
    {"facets", 1, 360},
    /* shares, and what a whole is */
    {"probability", 0, 1},
    {"specular", 0, 1},
    {"glass", 0, 1},
    {"mirror", 0, 1},
    {"signal.reflectance", 0, 1},
    {"surfaces[].reflectance", 0, 1},
    {"reaches[].reflectance", 0.001, 1},
    {"range_sigma_reflectance", 0.001, 1},
    /* standards: UTM has 60 zones, TCP and UDP 16 bits, IP an octet, USB 16 bits, IEEE 1588 octets and 64 bits */
    {"utm_zone", 0, 60},
    {"links[].port", 0, 65535},
    {"platform.port", 0, 65535},
    {"source_port", 0, 65535},
    {"ntp.port", 1, 65535},
    {"ttl", 1, 255},
    {"vid", 1, 65535},
    {"pid", 0, 65535},
    {"clock_class", 0, 255},
    {"clock_accuracy", 0, 255},
    {"grandmaster", 1, 18446744073709551615.0},
    {"announce_ms", 100, 64000}, /* 2^6 s */
    {"sync_ms", 250, 64000},
    {"zone_h", -12, 12},
    {"update_s", 1, 86400}, /* a day */
    {"ntp.max_offset_s", 0.001, 1e9},
    {"cycle_s", 0, 86400},
    /* GGA: two digits of satellites, qualities up to 5, two digits and one of HDOP */
    {"satellites", 0, 99},
    {"quality", 0, 5},
    {"hdop", 0.1, 99.9},
    {"gnss.rate_hz", 1, 20},
    {"geoid_separation_m", -120, 120}, /* EGM2008 goes from -107 to 86 m */
    {"stations[].height_m", -1000, 10000},
    {"scene.anchor.height_m", -1000, 10000},
    {"northing_m", -1e7, 2e7},
    /* octets of colours, four bits of an echo's number, 14 bits of a sample, 32 bits of an encoder */
    {"colour_rgb", 0, 255},
    {"max_echoes", 1, 15},
    {"bits", 8, 14},
    {"baseline_counts", 0, 8191.5},
    {"mirror_counts", 0, 4294967296},
    {"pan_counts", 0, 4294967296},
    {"first_step", 0, 999999},
    {"last_step", 0, 999999},
    {"front_step", 0, 999999},
    {"geometries[].steps_per_turn", 4, 18000},
    {"scene.import_memory_mib", 16, 16777216}, /* 2^44 bytes */
    {"scene.meshes", 1, 64},
    {"scene.target.objects", 0, 64},
    {"scene.import_files", 4, 1000},
    {"stations", 1, 64},
    {"surfaces", 0, 64},
    {"inputs", 0, 64},
    {"fields", 0, 48},
    {"fields[].number", 1, 48},
    {"fields[].response_ms", 0, 120000},
    {"faults", 0, 32},
    {"beams", 0, 128},
    {"head.station", 1, 4096},
    {"threads", 0, 64},
    {"beam.rings", 0, 18},
    {"links[].latency_ms", 0, 20},
    {"cast.sight_mib", 1, 65536},
    {"coverage.memory_mib", 1, 1048576},
    {"loop.tick_hz", 100, 10000},
    {"loop.ahead_ms", 2, 90},
    {"sample_ns", 0.05, 100},
    {"full_scale_db", 0, 90},
    {"saturation_db", 0, 90},
    {"lines_min_hz", 0.25, 10000},
    {"lines_max_hz", 0.25, 10000},
    /* arrays of 8; a LIDAR's colours; inputs and outputs of a scanner; ten minutes; half the room of a window */
    {"geometries", 0, 8},
    {"programs", 0, 8},
    {"reaches", 0, 8},
    {"links", 0, 8},
    {"faults[].link", 0, 8},
    {"links[].max_sessions", 1, 8},
    {"wavelength_nm", 400, 2000},
    {"inputs[].input", 1, 4},
    {"fields[].output", 0, 3},
    {"boot_s", 0, 600},
    {"spin_up_s", 0, 600},
    {"spin_down_s", 0, 600},
    {"waveform.before_ns", 0, 4000},
    {"waveform.after_ns", 0, 4000},
    {"waveform.skew", 1, 3},
    {"waveform.keep_db", -60, 60},
    {"faults[].loss_db", 0, 60},
    {"faults[].factor", 0.01, 2},
    {"links[].baud", 0, 4e6},
    {"gnss.nmea_late_ms", 0, 5000},
    {"optics.depth", 0, 4},
};

/* These keys are counted from one, or something is divided by them. Every other least number is 0, the negative of
 * the largest, a fraction, or 10 and more. */
static const char *const from_one[] = {
    "faults[].every", "faults[].from", "head.mta_zones", "platform.reach_m", "programs[].prr_hz", "programs[].used_hz",
    "prr_min_hz",     "prr_max_hz",    "steps_per_turn", "threshold_snr",    "time.ptp.max_ppm",
};

static int is_from_one(const char *path)
{
    for (size_t i = 0; i < sizeof from_one / sizeof *from_one; i++)
        if (strcmp(from_one[i], path) == 0) return 1;
    return 0;
}

static const struct limits *limits_of(const char *path)
{
    const char *dot = strrchr(path, '.'), *last = dot != NULL ? dot + 1 : path;
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++)
        if (strcmp(limits[i].word, path) == 0) return &limits[i];
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++)
        if (strcmp(limits[i].word, last) == 0) return &limits[i];
    return NULL;
}

static int is_number(const struct cfg_key *key)
{
    return key->type == CFG_COUNT || key->type == CFG_MICRO || key->type == CFG_REAL || key->type == CFG_VEC3 ||
           key->type == CFG_PAIR;
}

/* Returns whether it is 0 or a power of ten, with either sign. */
static int is_round(double value)
{
    char text[32];
    snprintf(text, sizeof text, "%.0e", fabs(value));
    return strtod(text, NULL) == fabs(value) && (text[0] == '0' || text[0] == '1');
}

static void expect_limits(const struct cfg_key *key)
{
    const struct limits *want = limits_of(key->path);
    const double any = key->type == CFG_MICRO ? 9e12 : ANY; /* where the profile has the limit */
    if (want != NULL && (key->min != want->min || key->max != want->max))
        fail_msg("%s: %.17g to %.17g, not %.17g to %.17g", key->path, key->min, key->max, want->min, want->max);
    if (want != NULL || key->min_key != NULL || key->max_key != NULL) return;
    if (!is_round(key->min) || (!is_round(key->max) && key->max != any))
        fail_msg("%s: %.17g to %.17g is not round", key->path, key->min, key->max);
    if ((key->min == 1) != is_from_one(key->path)) fail_msg("%s begins at %.17g", key->path, key->min);
    if (key->min < 0 && key->min != -key->max) fail_msg("%s: %.17g is not the other side", key->path, key->min);
}

/* There is more than one value, and the usual one is among them. */
static void expect_room(const struct cfg_key *key)
{
    char *end = NULL;
    const double usual = key->def != NULL ? strtod(key->def, &end) : 0;
    if (!(key->min < key->max)) fail_msg("%s: %.17g to %.17g", key->path, key->min, key->max);
    if (end == NULL || end == key->def || *end != '\0') return; /* none, or no number */
    if (usual < key->min || usual > key->max) fail_msg("%s: the usual %s is not allowed", key->path, key->def);
}

static void limits_come_from_somewhere(void **state)
{
    (void)state;
    const struct cfg_table *tables[] = {&cfg_config_table, &cfg_profile_table};
    for (int t = 0; t < 2; t++)
        for (size_t i = 0; i < tables[t]->n; i++) {
            const struct cfg_key *key = &tables[t]->keys[i];
            if (!is_number(key) && key->type != CFG_LIST) continue;
            expect_limits(key);
            expect_room(key);
        }
}

/* Each row above is of a key. */
static void no_row_is_left_over(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof limits / sizeof *limits; k++) {
        int n = 0;
        for (size_t i = 0; i < cfg_config_table.n; i++)
            n += limits_of(cfg_config_table.keys[i].path) == &limits[k];
        for (size_t i = 0; i < cfg_profile_table.n; i++)
            n += limits_of(cfg_profile_table.keys[i].path) == &limits[k];
        if (n == 0) fail_msg("no key is %s", limits[k].word);
    }
}

/* Where the allowed values are a text, it has the numbers of the row: "a divisor of 1e9 from 100 to 10000 Hz". */
static void texts_have_the_same_limits(void **state)
{
    (void)state;
    int n = 0;
    for (size_t i = 0; i < cfg_config_table.n; i++) {
        const struct cfg_key *key = &cfg_config_table.keys[i];
        const char *to = key->allowed != NULL && is_number(key) ? strstr(key->allowed, " to ") : NULL;
        const char *from = to;
        while (from > key->allowed && from != NULL && from[-1] != ' ')
            from--;
        if (to == NULL || key->min_key != NULL || strncmp(from, "range_", 6) == 0) continue; /* the profile's */
        if ((key->flags & CFG_HEX) != 0) {
            assert_true((double)strtoull(from, NULL, 16) == key->min && (double)strtoull(to + 4, NULL, 16) == key->max);
        } else if (strtod(from, NULL) != key->min && strstr(key->allowed, "0 (automatic)") == NULL) {
            fail_msg("%s: %s", key->path, key->allowed);
        }
        assert_true(strtod(to + 4, NULL) == key->max);
        n++;
    }
    assert_true(n >= 6);
}

/* Stores a number, given as text, in a configuration; a vector gets it three times, a pair twice. */
static int store(struct cfg_reader *rd, const struct cfg_key *key, const char *text)
{
    char all[256];
    if (key->type != CFG_VEC3 && key->type != CFG_PAIR) return cfg_store(rd, key, 0, 1, text, "");
    const int n = snprintf(all, sizeof all, "[%s, %s", text, text);
    if (key->type == CFG_VEC3)
        snprintf(all + n, sizeof all - (size_t)n, ", %s]", text);
    else
        strcpy(all + n, "]");
    return cfg_store(rd, key, 0, 1, all, "");
}

/* Writes the limit, or the nearest number beyond it that the type has. side: -1 below, 1 above, 0 the limit itself. */
static void write_limit(const struct cfg_key *key, double limit, int side, char text[64])
{
    if (key->type == CFG_COUNT && limit == ANY)
        snprintf(text, 64, "%s%s", key->flags & CFG_HEX ? "0x" : "",
                 side != 0              ? key->flags & CFG_HEX ? "10000000000000000" : "18446744073709551616"
                 : key->flags & CFG_HEX ? "ffffffffffffffff"
                                        : "18446744073709551615");
    else if (key->flags & CFG_HEX)
        snprintf(text, 64, "0x%llx", (unsigned long long)limit + (unsigned long long)side);
    else if (key->type == CFG_COUNT)
        snprintf(text, 64, "%lld", (long long)limit + side);
    else if (key->type == CFG_MICRO)
        snprintf(text, 64, "%.6f", limit + side * 1e-6);
    else
        snprintf(text, 64, "%.17g",
                 side == 0 ? limit : nextafter(limit, side < 0 ? -(double)INFINITY : (double)INFINITY));
}

static void a_limit_is_allowed_and_nothing_beyond(void **state)
{
    (void)state;
    static struct cfg_reader rd;
    char text[64];
    cfg_reader_init(&rd, "test.yaml", &cfg_config_table, cfg, &diagnostics);
    for (size_t i = 0; i < cfg_config_table.n; i++) {
        const struct cfg_key *key = &cfg_config_table.keys[i];
        if (!is_number(key) || key->min_key != NULL || key->max_key != NULL) continue;
        for (int side = -1; side <= 1; side += 2) {
            const double limit = side < 0 ? key->min : key->max;
            write_limit(key, limit, 0, text);
            if (store(&rd, key, text) != SH_OK) fail_msg("%s: %s is refused", key->path, text);
            if (side < 0 && limit == 0 && key->flags & CFG_HEX) continue; /* it has no sign */
            write_limit(key, limit, side, text);
            if (store(&rd, key, text) == SH_OK) fail_msg("%s: %s is taken", key->path, text);
        }
    }
}

/* A loaded configuration and a head profile have the limits of these rows. */
static void limits_hold_in_files(void **state)
{
    (void)state;
    assert_loads(load_set("loop.ahead_ms=90"));
    assert_int_equal(load_set("loop.ahead_ms=90.5"), SH_EINPUT);
    assert_says("--set loop.ahead_ms: \"90.5\" is out of range; allowed 2 to 90 ms");
    assert_loads(load_changed("leica-rtc360", "max_echoes: { value: 1,", "max_echoes: { value: 15,"));
    assert_int_equal(load_changed("leica-rtc360", "max_echoes: { value: 1,", "max_echoes: { value: 16,"), SH_EINPUT);
    assert_says("max_echoes: \"16\" is out of range; allowed a whole number, 1 to 15");
}

/* Each word stores the value that the rest of the program compares with. */
static void words_mean_their_values(void **state)
{
    (void)state;
    const struct {
        const char *path, *word;
        const int *member;
        int value;
    } words[] = {
        {"noise.ball.axes", "scene", &cfg->noise.ball.local, 0},
        {"noise.ball.axes", "beam", &cfg->noise.ball.local, 1},
        {"signal.detection", "noisy", &cfg->signal.sharp, 0},
        {"signal.detection", "sharp", &cfg->signal.sharp, 1},
        {"scene.anchor.hemisphere", "south", &cfg->scene.anchor.north, 0},
        {"scene.anchor.hemisphere", "north", &cfg->scene.anchor.north, 1},
        {"stations[].hemisphere", "south", &cfg->station[0].north, 0},
        {"stations[].hemisphere", "north", &cfg->station[0].north, 1},
        {"signal.model", "off", &cfg->signal.on, 0},
        {"signal.model", "on", &cfg->signal.on, 1},
        {"signal.model", "true", &cfg->signal.on, 1},
        {"signal.model", "false", &cfg->signal.on, 0},
    };
    static struct cfg_reader rd;
    cfg_reader_init(&rd, "test.yaml", &cfg_config_table, cfg, &diagnostics);
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        const struct cfg_key *key = cfg_find(&cfg_config_table, words[i].path);
        assert_int_equal(cfg_store(&rd, key, 0, 1, words[i].word, ""), SH_OK);
        if (*words[i].member != words[i].value) fail_msg("%s: %s", words[i].path, words[i].word);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(limits_come_from_somewhere), cmocka_unit_test(no_row_is_left_over),
        cmocka_unit_test(texts_have_the_same_limits), cmocka_unit_test(a_limit_is_allowed_and_nothing_beyond),
        cmocka_unit_test(words_mean_their_values),    cmocka_unit_test(limits_hold_in_files),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
