"""Every parameter of the pipeline, typed and frozen; an unknown key, a wrong type or an impossible value is refused.

``params.yaml`` is the configuration, composed from ``conf/``, that every stage reads. Only ``stages`` import this
package; the layers below take plain arguments.
"""
