/* The device and its commands: making it, carrying commands out, journal and replay. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/device/device_state.h"
#include "firmware_sim/site/plan_rows.h"

static void change_settings(struct device *device)
{
    if (!device->scanning) return;
    struct schedule_spec spec;
    device_fill_spec(device, &spec);
    schedule_change(&device->segment, &device->segment, &spec, device->pulse_next);
    device->describe = 1;
    device_push_event(device, NATIVE_EV_SETTINGS, device->pulse_next, 0, 0, "");
}

static void stop(struct device *device, enum head_event event, uint64_t tick)
{
    if (device->scanning)
        device->stop_requested = 1; /* the next claim ends the scan and tells the state machine */
    else
        device_transition(device, event, tick);
}

static void carry_out(struct device *device, enum command_effect effect, uint64_t released)
{
    switch (effect) {
    case COMMAND_SETTINGS:
        change_settings(device);
        break;
    case COMMAND_START:
        device_transition(device, HEAD_EV_START, released);
        break;
    case COMMAND_STOP:
        stop(device, HEAD_EV_STOP, released);
        break;
    case COMMAND_RESET:
        stop(device, HEAD_EV_RESET, released);
        break;
    case COMMAND_RELEASE:
        device_push_event(device, NATIVE_EV_CONTROL, 0, 0, 0, "released");
        break;
    case COMMAND_STEP:
    case COMMAND_NONE:
        break;
    }
}

void device_do_command(struct device *device, uint32_t session, const char *line, uint64_t released,
                       struct command_result *out)
{
    struct command_device *cmd = &device->cmd;
    cmd->state = device_visible_state(device, released);
    cmd->t_ns = (int64_t)released * device->tick_ns;
    device_set_time_texts(device);
    command_execute(cmd, session, line, out);
    if (out->took_control) device_push_event(device, NATIVE_EV_CONTROL, session, 0, 0, "taken");
    if (out->error != 0)
        device_push_event(device, NATIVE_EV_ERROR, (uint64_t)(int64_t)out->error, session, 0,
                          command_error_text(out->error));
    else if (out->changes && device->journal != NULL && out->effect != COMMAND_STEP)
        journal_write(device->journal, device->next_tick, cmd->t_ns, session, line);
    if (out->error == 0) carry_out(device, out->effect, released);
}

void device_command(struct device *device, uint32_t session, const char *line, uint64_t released,
                    struct command_result *out)
{
    pthread_mutex_lock(&device->lock);
    device_do_command(device, session, line, released, out);
    pthread_mutex_unlock(&device->lock);
}

void device_report(struct device *device, int number, const char *text)
{
    pthread_mutex_lock(&device->lock);
    command_queue_push(&device->cmd.queue, number, text);
    device_push_event(device, NATIVE_EV_ERROR, (uint64_t)(int64_t)number, 0, 0, text);
    pthread_mutex_unlock(&device->lock);
}

void device_overlong(struct device *device, uint32_t session, struct command_result *out)
{
    memset(out, 0, sizeof *out);
    char text[96];
    snprintf(text, sizeof text, "session %u, longest line %d bytes", session, COMMAND_MAX_LINE);
    device_report(device, CMD_E_OVERRUN, text);
    out->error = CMD_E_OVERRUN;
    snprintf(out->reply, sizeof out->reply, "ERR %d,\"%s; %s\"", CMD_E_OVERRUN, command_error_text(CMD_E_OVERRUN),
             text);
}

void device_session_closed(struct device *device, uint32_t session, const char *who, int partial)
{
    pthread_mutex_lock(&device->lock);
    int in_control = device->cmd.control == session;
    if (in_control) {
        device->cmd.control = 0;
        device_push_event(device, NATIVE_EV_CONTROL, 0, 0, 0, "client gone");
    }
    int scanning = device->scanning;
    pthread_mutex_unlock(&device->lock);
    char text[96];
    snprintf(text, sizeof text, "session %u, %.60s", session, who);
    if (partial) device_report(device, CMD_E_PARTIAL, text);
    if (in_control || scanning) device_report(device, CMD_E_CLIENT_LOST, text);
}

/* The first pulse of a tick may be 15 periods old. */
static int check_live(const struct device *device, struct sh_err *err)
{
    const struct config *cfg = device->site->cfg;
    double ticks = SCHEDULE_PACKET * 1e6 / (double)cfg->profile.prr_min_uhz * (double)device->tick_hz + 3.0;
    if (cfg->platform.kind != PLATFORM_LIVE || ticks <= DEVICE_MAX_POSES) return SH_OK;
    return sh_fail(err, SH_EINPUT, "%s: platform.kind: live needs prr_min_hz of head profile %s to be at least %.0f",
                   cfg->file, cfg->profile.name, SCHEDULE_PACKET * (double)device->tick_hz / (DEVICE_MAX_POSES - 3.0));
}

static int set_limits(struct device *device, struct sh_err *err)
{
    const struct config *cfg = device->site->cfg;
    const struct config_profile *p = &cfg->profile;
    device->cmd.limits = (struct head_limits){.prr_min_uhz = p->prr_min_uhz,
                                              .prr_max_uhz = p->prr_max_uhz,
                                              .lines_min_uhz = p->lines_min_uhz,
                                              .lines_max_uhz = p->lines_max_uhz,
                                              .pan_max_udeg_s = p->pan_max_udeg_s,
                                              .fov_min_udeg = p->fov_min_udeg,
                                              .fov_max_udeg = p->fov_max_udeg,
                                              .pan_min_udeg = p->pan_min_udeg,
                                              .pan_max_udeg = p->pan_max_udeg,
                                              .n_stations = device->site->n_stations};
    device->cmd.settings = device->cmd.defaults = cfg->head.settings;
    char idn[256];
    snprintf(idn, sizeof idn, "%s,%s,%s,scanhead native %d", p->maker, p->model, cfg->head.serial, NATIVE_VERSION);
    if (strlen(idn) >= sizeof device->idn)
        return sh_fail(err, SH_EINPUT,
                       "%s: maker, model and head.serial are together too long for *IDN?; at most %zu bytes", cfg->file,
                       sizeof device->idn - 1 - strlen(",,,scanhead native 1"));
    strcpy(device->idn, idn);
    device->cmd.idn = device->idn;
    site_plan_text(device->site, device->plan, sizeof device->plan);
    device->cmd.plan = device->plan;
    device->cmd.step_allowed = cfg->loop.pace == PACE_STEP;
    device->cmd.pose_allowed = cfg->platform.kind == PLATFORM_LIVE;
    memcpy(device->cmd.pose_centre_m, device->site->station[0].at.position_m, sizeof device->cmd.pose_centre_m);
    device->cmd.pose_reach_m = cfg->platform.reach_m;
    return SH_OK;
}

static int open_journals(struct device *device, struct sh_err *err)
{
    int rc = SH_OK;
    if (device->options.replay != NULL)
        rc = journal_read(device->options.replay, &device->replay, &device->n_replay, err);
    if (rc != SH_OK || device->options.journal == NULL) return rc;
    device->journal = journal_open(device->options.journal, err);
    if (device->journal == NULL) return err->code;
    char note[16 + sizeof device->plan];
    snprintf(note, sizeof note, "plan: %s", device->plan);
    journal_note(device->journal, note); /* what went wrong, journal_close says */
    return SH_OK;
}

int device_create(const struct site *site, const struct device_options *options, struct device **out,
                  struct sh_err *err)
{
    *out = NULL;
    struct device *device = calloc(1, sizeof *device);
    if (device == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    pthread_mutex_init(&device->lock, NULL);
    device->site = site;
    device->options = *options;
    device->tick_hz = (uint64_t)llround(site->cfg->loop.tick_hz);
    device->tick_ns = 1000000000 / (int64_t)device->tick_hz;
    device->due_tick = device->end_tick = device->lost_first = UINT64_MAX;
    if (options->duration_s > 0.0 && !options->start)
        device->end_tick = (uint64_t)ceil(options->duration_s * (double)device->tick_hz);
    int rc = set_limits(device, err);
    if (rc == SH_OK) rc = check_live(device, err);
    if (rc == SH_OK) rc = head_clock_create(site->cfg, &device->clock, err);
    gnss_init(&device->gnss, site, &device->clock);
    if (rc == SH_OK) rc = open_journals(device, err);
    if (rc != SH_OK) {
        device_free(device);
        return rc;
    }
    device_transition(device, HEAD_EV_POWER_ON, 0);
    *out = device;
    return SH_OK;
}

int device_close_journal(struct device *device, struct sh_err *err)
{
    int rc = journal_close(device->journal, err);
    device->journal = NULL;
    return rc;
}

void device_free(struct device *device)
{
    if (device == NULL) return;
    journal_close(device->journal, NULL);
    journal_free(device->replay);
    pthread_mutex_destroy(&device->lock);
    free(device);
}
