/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/load.h"
#include "tests/common/free_fd.h"
#include "tests/unit/device_rig.h"

char folder[64];
char journal_path[96];
static int fd_before;

int write_scene(uint32_t n_objects)
{
    char path[96];
    snprintf(path, sizeof path, "%s/room.obj", folder);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    for (uint32_t i = 0; i < n_objects; i++) {
        fprintf(f, "o object-%u\n", i);
        for (int v = 0; v < 8; v++)
            fprintf(f, "v %g %g %g\n", 10.0 * i + (v & 1 ? 4 : -4), v & 2 ? 5.0 : -5.0, v & 4 ? 3.0 : -2.0);
        fprintf(f, "f -8 -7 -5 -6\nf -8 -7 -3 -4\nf -6 -5 -1 -2\nf -8 -6 -2 -4\nf -7 -5 -1 -3\n");
    }
    return fclose(f);
}

int write_profile(void)
{
    char path[96];
    snprintf(path, sizeof path, "%s/head.yaml", folder);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    static const struct {
        const char *key;
        double value;
    } figure[] = {
        {"prr_min_hz", 1000},    {"prr_max_hz", 2000000}, {"lines_min_hz", 1},    {"lines_max_hz", 2000},
        {"pan_max_deg_s", 360},  {"fov_min_deg", -40},    {"fov_max_deg", 60},    {"pan_min_deg", 0},
        {"pan_max_deg", 360},    {"facets", 3},           {"optical_gain", 2},    {"range_min_m", 0.5},
        {"range_max_m", 100},    {"range_sigma_m", 0},    {"range_sigma_ppm", 0}, {"mirror_counts", 1048576},
        {"pan_counts", 1048576}, {"max_echoes", 1},       {"beam_exit_m", 0.007}, {"beam_divergence_rad", 3.5e-4},
        {"pulse_width_ns", 4},   {"boot_s", 0.2},         {"spin_up_s", 0.03},    {"spin_down_s", 0.05}};
    fprintf(f, "maker: Maker\nmodel: Model\n");
    for (size_t i = 0; i < sizeof figure / sizeof *figure; i++)
        fprintf(f, "%s: { value: %.10g, from: assumed }\n", figure[i].key, figure[i].value);
    return fclose(f);
}

static int write_config(void)
{
    char path[96];
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    FILE *f = fopen(path, "w");
    if (f == NULL) return -1;
    fprintf(f,
            "head:\n  profile: %s/head.yaml\n  prr_hz: 300000\n  lines_hz: 100\n  pan_deg_s: 180\n  "
            "pan_stop_deg: 90\n"
            "scene:\n  meshes:\n    - file: room.obj\n      up: z\n      scale: 1\n"
            "stations:\n  - position_m: [0, 0, 0]\n  - position_m: [0.5, 0, 0]\n",
            folder);
    return fclose(f);
}

int make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/scanhead-device-XXXXXX");
    fd_before = free_fd();
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(journal_path, sizeof journal_path, "%s/journal", folder);
    return write_profile() != 0 || write_config() != 0 || write_scene(2) != 0 ? -1 : 0;
}

int remove_folder(void **state)
{
    (void)state;
    static const char *const names[] = {"room.obj", "head.yaml", "run.yaml", "journal"};
    char path[96];
    for (size_t i = 0; i < 4; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    return rmdir(folder) != 0 ? -1 : free_fd_check(fd_before);
}

void need(int rc, const struct sh_err *err)
{
    if (rc != SH_OK) fail_msg("%s", err->text);
}

struct rig *rig_open(const struct device_options *options, const char *const *sets, int n_sets)
{
    return rig_open_file("run.yaml", options, sets, n_sets);
}

struct rig *rig_open_file(const char *name, const struct device_options *options, const char *const *sets, int n_sets)
{
    static const struct device_options none = {0};
    struct sh_err err;
    char path[96];
    struct rig *rig = calloc(1, sizeof *rig);
    assert_non_null(rig);
    rig->cfg = calloc(1, sizeof *rig->cfg);
    assert_non_null(rig->cfg);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    need(config_load(path, sets, n_sets, rig->cfg, &err), &err);
    need(site_load(rig->cfg, NULL, &rig->site, &err), &err);
    need(device_create(rig->site, options != NULL ? options : &none, &rig->device, &err), &err);
    need(worker_create(rig->site, &rig->worker, &err), &err);
    return rig;
}

void rig_close(struct rig *rig)
{
    struct sh_err err;
    worker_free(rig->worker);
    free(rig->slot.longer);
    need(device_close_journal(rig->device, &err), &err);
    device_free(rig->device);
    site_free(rig->site);
    free(rig->cfg);
    free(rig);
}

int rig_claim(struct rig *rig)
{
    device_done(&rig->work);
    if (device_claim(rig->device, &rig->work) != 0) {
        rig->over = 1;
        return 0;
    }
    assert_true(rig->work.tick == rig->next);
    rig->next++;
    return 1;
}

void rig_go_to(struct rig *rig, uint64_t tick)
{
    while (rig->next < tick)
        assert_true(rig_claim(rig));
}

const struct ring_tick *rig_fill(struct rig *rig)
{
    const struct ring_tick *tick = &rig->slot.tick;
    assert_int_equal(worker_fill(rig->worker, &rig->work, &rig->slot), SH_OK);
    assert_true(tick->len <= worker_tick_bytes(rig->site) && tick->n_marks <= RING_MAX_MARKS);
    return tick;
}

const char *rig_tell(struct rig *rig, const char *line, uint64_t released)
{
    static struct command_result result;
    device_command(rig->device, 1, line, released, &result);
    if (result.error != 0) fail_msg("%s: %s", line, result.reply);
    return result.reply;
}

const char *rig_state(struct rig *rig, uint64_t released)
{
    return rig_tell(rig, "HEAD:STATE?", released);
}

const struct native_event *rig_event(const struct rig *rig, enum native_event_code code)
{
    for (uint32_t i = 0; i < rig->work.n_events; i++)
        if (rig->work.event[i].code == (uint32_t)code) return &rig->work.event[i];
    return NULL;
}

const struct native_event *rig_wait(struct rig *rig, enum native_event_code code, uint64_t most)
{
    for (uint64_t i = 0; i < most && rig_claim(rig); i++)
        if (rig_event(rig, code) != NULL) return rig_event(rig, code);
    fail_msg("no event %d within %u ticks", (int)code, (unsigned)most);
    return NULL;
}
