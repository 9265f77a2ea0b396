# SPDX-License-Identifier: MIT
# make deb: packages for Debian, in build/deb. make deb-check: installs, tries and removes them in a new root, as root.
DEPS_DEB = debhelper fakeroot lintian
DEPS_DEB_CHECK = mmdebstrap systemd-container
DEB_DIR = $(BUILD)/deb
DEB_TREE = $(DEB_DIR)/scanhead
RELEASE = $(shell sed -n 's/^\#define SCANHEAD_VERSION  *"\(.*\)"$$/\1/p' drivers/host/scanhead.h)
# A release consists of all that is at the top.
DEB_SOURCES = Makefile README.md CHANGELOG.md LICENSE config core drivers firmware_sim tests
# The changelog's date: that of the commit, else of the header that has the version.
DEB_TIME = $${SOURCE_DATE_EPOCH:-$$(git log -1 --format=%ct 2>/dev/null || stat -c %Y drivers/host/scanhead.h)}
DEB_DATE = $(shell date -R -u -d "@$(DEB_TIME)")

#? deb               Debian's packages into build/
deb:
	$(call install_missing,$(DEPS_BUILD) $(DEPS_DEB))
	@rm -rf --one-file-system $(DEB_DIR)
	@mkdir -p $(DEB_TREE)
	@tar --exclude=__pycache__ --exclude=.git -cf - $(DEB_SOURCES) | tar -xf - -C $(DEB_TREE)
	@$(MAKE) --no-print-directory ifc-readers
	@[ ! -e $(IFC_READERS)/installed ] || { mkdir -p $(DEB_TREE)/build && cp -r $(IFC_READERS) $(DEB_TREE)/build/ifc; }
	@cp -r config/packaging/debian $(DEB_TREE)/
	@cp config/packaging/copyright $(DEB_TREE)/debian/
	@rm $(DEB_TREE)/debian/README.md
	@mkdir $(DEB_TREE)/debian/source && echo '3.0 (quilt)' >$(DEB_TREE)/debian/source/format
	@printf 'scanhead (%s-1) unstable; urgency=medium\n\n  * Release %s.\n\n -- %s  %s\n' '$(RELEASE)' '$(RELEASE)' \
		"$$(sed -n 's/^Maintainer: //p' config/packaging/debian/control)" '$(DEB_DATE)' >$(DEB_TREE)/debian/changelog
	@cd $(DEB_TREE) && env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u BUILD DEB_BUILD_OPTIONS="parallel=$(JOBS) nocheck" \
		dpkg-buildpackage -us -uc -b
	@rm -rf $(DEB_TREE)
	@ls -l $(DEB_DIR)/*.deb
#? deb-check         installs, tries and removes the packages in a new root
deb-check: deb
	$(call install_missing,$(DEPS_DEB_CHECK))
	@bash config/packaging/check.sh $(DEB_DIR) $(RELEASE) | tee $(DEB_DIR)/check.log
	@grep -q '^1\.\.' $(DEB_DIR)/check.log && ! grep '^not ok' $(DEB_DIR)/check.log
.PHONY: deb deb-check
