/* SPDX-License-Identifier: MIT */
/* Settings that the head keeps without power. These settings are the head's at power-up, so *RST and DEF mean them,
 * too. */
#include <stdio.h>

#include "firmware_sim/command/stored.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"

static const char head_name[] = "head";

void device_keep_settings(struct device *device)
{
    const struct head_settings *configured = &device->site->cfg->head.settings;
    char text[SETTINGS_FILE_TEXT];
    if (device->scan.number == 0) device_before_scans(device); /* its descriptor has the settings of power-up */
    if (device->settings != NULL && command_stored_text(&device->cmd, configured, text, sizeof text) == 0)
        settings_file_put(device->settings, head_name, text);
}

static void restore_line(void *ctx, const char *line)
{
    device_carry_out_line(ctx, line);
}

int device_restore(struct device *device, struct sh_err *err)
{
    char text[SETTINGS_FILE_TEXT] = "", why[COMMAND_MAX_REPLY];
    struct settings_file *settings = device->options.settings;
    if (settings != NULL) settings_file_get(settings, head_name, text);
    if (text[0] != '\0') {
        if (command_stored_apply(&device->cmd, text, restore_line, device, why, sizeof why) != 0)
            return sh_fail(err, SH_EINPUT, "head.settings_file: %s: %s; correct it, or remove the file",
                           settings_file_path(settings), why);
        if (device->cmd.server.role == COMMAND_TIME_CLIENT && device->site->cfg->loop.pace != PACE_REALTIME)
            return sh_fail(err, SH_EINPUT,
                           "head.settings_file: %s: TIME:SERVer CLIENT is stored, and a server's time is real; allowed "
                           "with loop.pace realtime, or use another file",
                           settings_file_path(settings));
        device_carry_out_line(device, "HEAD:STORe");
    }
    device->settings = settings;
    return SH_OK;
}

int device_store(void *self, const char *name, const char *text)
{
    struct device *device = self;
    return device->settings == NULL || settings_file_put(device->settings, name, text) != SH_OK;
}

int device_stored(const void *self, const char *name, char text[SETTINGS_FILE_TEXT])
{
    const struct device *device = self;
    text[0] = '\0';
    if (device->settings == NULL) return 1;
    settings_file_get(device->settings, name, text);
    return 0;
}
