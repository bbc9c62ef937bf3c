"""The options of a service that steers a landing on the label "pad"."""

from fwav_companion.publishing.options import PublishOptions

OPTIONS = PublishOptions(landing_target=True, landing_label="pad")
