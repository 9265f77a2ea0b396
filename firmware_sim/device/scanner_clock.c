/* SPDX-License-Identifier: MIT */
#include "firmware_sim/device/scanner_clock.h"

#include <arpa/inet.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/eventfd.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"

enum { LOOPBACK = 127 };

void device_init_time_server(struct device *device)
{
    const struct config_ntp *ntp = &device->site->cfg->ntp;
    struct command_device *cmd = &device->cmd;
    cmd->server_configured = (struct command_time_server){
        .role = (uint32_t)ntp->role, .update_s = ntp->update_s, .zone_h = (int32_t)ntp->zone_h};
    inet_pton(AF_INET, ntp->address, cmd->server_configured.address);
    cmd->server = cmd->server_default = cmd->server_configured;
    device->server_fd = -1;
}

void device_start_date(struct device *device, int64_t t_ns)
{
    struct command_device *cmd = &device->cmd;
    device->date_before = device->date;
    device->date_before.shift_ns = cmd->shift_ns;
    cmd->server = cmd->server_default;
    cmd->shift_ns = 0;
    cmd->answers = (struct command_time_answers){.max_offset_ns = llround(1e9 * device->site->cfg->ntp.max_offset_s)};
    device->date =
        (struct scanner_clock){.from_ns = t_ns,
                               .by_utc = device->clock.source != EPOCH_NONE && cmd->server.role != COMMAND_TIME_CLIENT,
                               .zero_ns = head_clock_ns(&device->clock, t_ns)};
}

int64_t device_date_ns(void *self, int64_t t_ns)
{
    struct device *device = self;
    const struct head_clock *clock = &device->clock;
    pthread_mutex_lock(&device->lock);
    const int is_before = t_ns < device->date.from_ns;
    const struct scanner_clock *date = is_before ? &device->date_before : &device->date;
    const int64_t head_ns = head_clock_ns(clock, t_ns);
    const int64_t began_ns = date->by_utc ? utc_posix_from_tai(&clock->table, head_ns) : head_ns - date->zero_ns;
    const int64_t date_ns = began_ns + (is_before ? date->shift_ns : device->cmd.shift_ns);
    pthread_mutex_unlock(&device->lock);
    return date_ns;
}

static int may_be_asked(const struct device *device, const uint8_t address[4])
{
    return address[0] == LOOPBACK || device->site->cfg->ntp.anywhere ||
           memcmp(address, device->cmd.server_configured.address, 4) == 0;
}

void device_get_time_server(struct device *device, struct device_time_server *out)
{
    const struct config_ntp *ntp = &device->site->cfg->ntp;
    pthread_mutex_lock(&device->lock);
    const struct command_time_server *set = &device->cmd.server;
    const enum head_state state = device->machine.state;
    const int wants =
        set->role == COMMAND_TIME_CLIENT && set->interface == 0 && state != HEAD_OFF && state != HEAD_BOOT;
    const int may = may_be_asked(device, set->address);
    *out = (struct device_time_server){.set = *set,
                                       .port = (uint16_t)ntp->port,
                                       .asks = wants && may,
                                       .refused = wants && !may,
                                       .power_ons = device->power.n_ups,
                                       .max_offset_ns = device->cmd.answers.max_offset_ns};
    pthread_mutex_unlock(&device->lock);
}

void device_watch_time_server(struct device *device, int fd)
{
    pthread_mutex_lock(&device->lock);
    device->server_fd = fd;
    device->cmd.asks_server = fd >= 0;
    pthread_mutex_unlock(&device->lock);
}

void device_say_time_server(const struct device *device)
{
    if (device->server_fd >= 0) eventfd_write(device->server_fd, 1);
}

int device_change_time_answer(struct device *device, int64_t t_ns, uint8_t packet[NTP_LEN])
{
    static const struct {
        enum fault_kind kind;
        enum ntp_change change;
    } changes[] = {{FAULT_NTP_STEP, NTP_STEP}, {FAULT_NTP_UNSYNC, NTP_UNSYNCHRONISE}, {FAULT_NTP_KISS, NTP_DENY}};
    struct head_faults *faults = &device->head_faults;
    struct head_fault *f = NULL;
    int is_silent = 0;
    pthread_mutex_lock(&device->lock);
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++)
        while ((f = head_faults_at(faults, changes[i].kind, t_ns, f)) != NULL) {
            ntp_change_answer(packet, changes[i].change, llround(1e9 * f->fault.jump_s));
            f->n++;
        }
    while ((f = head_faults_at(faults, FAULT_NTP_SILENT, t_ns, f)) != NULL) {
        is_silent = 1;
        f->n++;
    }
    pthread_mutex_unlock(&device->lock);
    return is_silent;
}

int device_shift_date(struct device *device, const struct device_time_server *asked, int64_t by_ns)
{
    char line[40];
    pthread_mutex_lock(&device->lock); /* a client may set the clock, and power may go, at any moment */
    const int is_asked =
        memcmp(&device->cmd.server, &asked->set, sizeof asked->set) == 0 && device->power.n_ups == asked->power_ons;
    if (is_asked) {
        snprintf(line, sizeof line, "TIME:SHIFt %lld", (long long)(device->cmd.shift_ns + by_ns));
        device_carry_out_line(device, line);
    }
    pthread_mutex_unlock(&device->lock);
    return is_asked;
}

void device_put_time_answers(struct device *device, const struct command_time_answers *answers, const char *report)
{
    pthread_mutex_lock(&device->lock);
    device->cmd.answers = *answers;
    pthread_mutex_unlock(&device->lock);
    if (report != NULL) device_report(device, CMD_E_TIME, report);
}
